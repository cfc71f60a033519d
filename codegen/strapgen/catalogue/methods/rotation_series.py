"""The rotation vector of a step as a series in the rate, with terms of first, second and higher order.

Bortz's equation is integrated term by term for a rate that is a sum of vectors, each times a function of time. The
terms are sums of nested cross products a x (b x (c x d)). Such a product is a word: the tuple of the numbers of its
vectors, from left to right.

`magnus` is the Magnus series. That of order 2 is the integral of the rate; that of order 4 adds the complete term of
second order in the rate; that of order 6 adds the terms of third and fourth order up to the sixth power of the step.
Coning drift is of second order in the rate, so a step on more samples than its order needs gains from all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.method import PHI, Method, Samples, exponential
from strapgen.catalogue.methods.runge_kutta import bortz_coefficient
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross, dot, exact
from strapgen.kernel.kernel import KernelBuilder

SOURCE = "W. Magnus, Commun. Pure Appl. Math. 7 (1954) 649-673; K.-T. Chen, Ann. Math. 65 (1957) 163-178"

#: A nested cross product of numbered vectors, and a sum of such products with their coefficients.
Word = tuple[int, ...]
Words = dict[Word, Fraction]
#: Coefficients by the numbers of two vectors, of scalar products or of cross products.
Scalars = dict[tuple[int, int], Fraction]


@cache
def terms(vectors: int, order: int) -> tuple[Words, ...]:
    """Return the words of each order in r_j up to `order`, for the rate sum_j r_j t^j over a step, t from 0 to 1.

    The equation dphi/dt = sum_k b_k phi x (phi x ... w) with k products is solved order by order in the rate w. The
    right-hand side of order m only needs the terms of lower orders.

    >>> first, second = terms(2, 2)
    >>> first, second[0, 1] - second[1, 0]
    ({(0,): Fraction(1, 1), (1,): Fraction(1, 2)}, Fraction(1, 12))
    """
    rate: Words = {(j,): Fraction(1) for j in range(vectors)}
    solved = [_integral(rate)]
    nested: list[dict[int, Words]] = [{1: rate}]  # by number of products, the parts of every order
    for m in range(2, order + 1):
        derivative: Words = {}
        for k in range(1, m):
            if k == len(nested):
                nested.append({})
            part: Words = {}
            for a in range(1, m):
                if m - a in nested[k - 1]:
                    _add(part, cross_words(solved[a - 1], nested[k - 1][m - a]))
            nested[k][m] = part
            b = bortz_coefficient(k)
            _add(derivative, part, Fraction(int(b.p), int(b.q)))
        solved.append(_integral(derivative))
    return tuple(solved)


@cache
def legendre_terms(vectors: int, order: int) -> tuple[Words, ...]:
    """Return the terms for the rate sum_m l_m P_m with the Legendre polynomials P_m of the step, as `terms`.

    Many coefficients vanish here, because reversing time changes the sign of the rotation vector.
    """
    table = [
        {m: fraction(rate_fit.legendre(m)[j]) for m in range(j, vectors)} for j in range(vectors)
    ]  # r_j in the l_m
    return tuple(substituted(words, table) for words in terms(vectors, order))


def substituted(words: Words, table: Sequence[Mapping[int, Fraction]]) -> Words:
    """Return words with each vector replaced by a sum of others, whose coefficients are in the table."""
    length = max(map(len, words), default=0)
    for place in range(length):
        replaced: Words = {}
        for word, c in words.items():
            for other, weight in table[word[place]].items():
                _add(replaced, {(*word[:place], other, *word[place + 1 :]): c * weight})
        words = {word: c for word, c in replaced.items() if c}
    return words


def in_samples(terms: Words, increments: int, previous: int = 0) -> Words:
    """Convert a term in r_0, r_1, ... to the samples of the polynomial rate."""
    fit = rate_fit.from_increments(increments, previous)
    return substituted(
        terms,
        [{k: fraction(w) for k, w in enumerate(fit.taylor(j))} for j in range(increments + previous)],
    )


def cross_words(left: Words, right: Words) -> Words:
    """Return the cross product of two sums of words, as a sum of words.

    >>> cross_words({(0, 1): Fraction(1)}, {(2,): Fraction(1)})  # (a x b) x c = a x (b x c) - b x (a x c)
    {(0, 1, 2): Fraction(1, 1), (1, 0, 2): Fraction(-1, 1)}
    """
    product: Words = {}
    for word, a in left.items():
        for other, b in right.items():
            _add(product, _product(word, other), a * b)
    return product


def pairs(words: Words) -> Scalars:
    """Return words of two vectors as coefficients of r_i x r_j, by (i, j), i < j, without zeros."""
    collected: Words = {}
    for (i, j), c in words.items():
        if i != j:
            _add(collected, {(min(i, j), max(i, j)): c if i < j else -c})
    return {(i, j): c for (i, j), c in sorted(collected.items()) if c}


def third_order(words: Words) -> dict[int, Scalars]:
    """Return words of three vectors as vectors r_k, each times a sum of scalar products r_i . r_j, i <= j.

    It uses a x (b x c) = b (a . c) - c (a . b). The coefficients are unique, since the vectors are arbitrary.
    """
    collected: dict[int, Scalars] = {}
    for (a, b, c), weight in words.items():
        _collect(collected.setdefault(b, {}), a, c, weight)
        _collect(collected.setdefault(c, {}), a, b, -weight)
    return {k: weights for k, row in sorted(collected.items()) if (weights := _nonzero(row))}


def fourth_order(words: Words) -> dict[tuple[int, int], Scalars]:
    """Return words of four vectors as products r_k x r_l, k < l, each times a sum of scalar products r_i . r_j, i <= j.

    It uses a x (b x (c x d)) = (b . d) a x c - (b . c) a x d. The coefficients are unique, since the vectors are
    arbitrary.
    """
    collected: dict[tuple[int, int], Scalars] = {}
    for (a, b, c, d), weight in words.items():
        for left, other, sign in ((c, d, 1), (d, c, -1)):
            # It is minus the product of the swapped vectors, and 0 of a vector with itself.
            key, turned = (min(a, left), max(a, left)), sign * ((a < left) - (left < a))
            _collect(collected.setdefault(key, {}), b, other, turned * weight)
    return {key: weights for key, row in sorted(collected.items()) if (weights := _nonzero(row))}


def fraction(number: sp.Expr) -> Fraction:
    """Return a rational number of SymPy as a fraction."""
    return Fraction(int(number.p), int(number.q))


def _product(word: Word, other: Word) -> Words:
    """Return the cross product of two words, by (a x p) x q = a x (p x q) - p x (a x q) for a single vector a."""
    if len(word) == 1:
        return {} if word == other else {word + other: Fraction(1)}
    head, rest = word[:1], word[1:]
    collected: Words = {head + inner: c for inner, c in _product(rest, other).items()}
    _add(collected, _product(rest, head + other), Fraction(-1))
    return collected


def _integral(words: Words) -> Words:
    """Return the integrals of words from time 0, as coefficients of the next power of time.

    A word of the vectors j comes with t to the power sum (j + 1) - 1.
    """
    return {word: c / sum(j + 1 for j in word) for word, c in words.items() if c}


def _add(total: Words, words: Words, factor: Fraction = Fraction(1)) -> None:
    for word, c in words.items():
        total[word] = total.get(word, Fraction(0)) + factor * c


def _collect(row: Scalars, i: int, j: int, weight: Fraction) -> None:
    key = (min(i, j), max(i, j))
    row[key] = row.get(key, Fraction(0)) + weight


def _nonzero(row: Scalars) -> Scalars:
    return {key: c for key, c in sorted(row.items()) if c}


def rotation_vector(
    build: KernelBuilder, vectors: Sequence[sp.Matrix], terms: tuple[Scalars, Words, Words]
) -> sp.Matrix:
    """Add stages for the rotation vector to fourth order from Legendre coefficients of the rate times the step, in rad.

    The terms are the coefficients of the cross products of second order, and the words of third and of fourth order.
    """
    second = terms[0]
    third, fourth = third_order(terms[1]), fourth_order(terms[2])
    products: dict[tuple[int, int], sp.Symbol] = {}

    def weight(constant: Fraction, row: Scalars) -> sp.Expr:
        total = exact(constant)
        for (i, j), c in row.items():
            if (i, j) not in products:
                products[i, j] = build.value(
                    f"product_{i}_{j}",
                    dot(vectors[i], vectors[j]),
                    f"scalar product of Legendre coefficients {i} and {j}",
                )
            total += exact(c) * products[i, j]
        return total

    phi = sp.zeros(3, 1)
    for k in range(len(vectors)):
        value = weight(Fraction(int(k == 0)), third.get(k, {}))
        if value.is_Rational:
            phi += value * vectors[k]
        else:
            phi += build.value(f"weight_{k}", value, f"weight of Legendre coefficient {k}") * vectors[k]
    for k, m in sorted({*second, *fourth}):
        product = build.stage(
            Signal.vector(
                f"cross_{k}_{m}",
                f"cross_{k}_{m}",
                meaning=f"cross product of Legendre coefficients {k} and {m}",
            ),
            cross(vectors[k], vectors[m]),
        )
        value = weight(second.get((k, m), Fraction(0)), fourth.get((k, m), {}))
        if value.is_Rational:
            phi += value * product
        else:
            phi += build.value(f"weight_{k}_{m}", value, "weight of that cross product") * product
    return build.stage(PHI, phi)


_MAGNUS_SOURCE = "S. Blanes, F. Casas, J. A. Oteo, J. Ros, Phys. Rep. 470 (2009) 151-238, section 5.3"

#: Gauss-Legendre nodes by their number, for steps that take rates.
_GAUSS = {
    1: (sp.Rational(1, 2),),
    2: (sp.Rational(1, 2) - sp.sqrt(3) / 6, sp.Rational(1, 2) + sp.sqrt(3) / 6),
    3: (sp.Rational(1, 2) - sp.sqrt(15) / 10, sp.Rational(1, 2), sp.Rational(1, 2) + sp.sqrt(15) / 10),
}


def magnus(order: int) -> Method:
    """Return the Magnus series of order 2, 4 or 6: exact to its order for any rate, and always a rotation."""

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        if order == 2:
            return _moment(samples, 0)
        return build.stage(PHI, (_fourth if order == 4 else _sixth)(build, samples))

    return exponential(
        f"magnus{order}",
        f"Magnus series of order {order}",
        _MAGNUS_SOURCE,
        order,
        rotation_vector,
        nodes=_GAUSS[order // 2],
    )


def _moment(samples: Samples, power: int) -> sp.Matrix:
    """Add a stage for the integral over the step of the rate times (t - 1/2)^power, t in steps."""
    meaning = (
        "integral of the rate over the step"
        if power == 0
        else "integral of the rate times t - 1/2, t in steps"
    )
    return samples.combination(f"moment_{power}", samples.fit.moment(power), meaning)


# Magnus series: the rotation vector of a step from integrals of the rate, and its exponential.
#
# The series of order 2 is the integral of the rate. The series of order 4 adds the complete term of second order in the
# rate; that of order 6 adds the terms of third and fourth order up to the sixth power of the step. Coning drift is of
# second order in the rate, so a step on more samples than its order needs gains from all of them.


def _legendre_moment(samples: Samples, degree: int) -> list[sp.Expr]:
    """Return the weights of the samples in the integral over the step of the rate times a Legendre polynomial."""
    return [weight / (2 * degree + 1) for weight in samples.fit.legendre(degree)]


def _second_order(samples: Samples, first: int) -> sp.Matrix:
    """Return the term of second order in the rate, for its Legendre polynomials from the even degree `first` on.

    With the integrals m_k of the rate times the Legendre polynomial P_k the term is half the sum of m_k x m_(k+1):
    the integral of P_k is a difference of P_(k+1) and P_(k-1), so that all other products vanish. Two products that
    share the vector of odd degree are taken as one, (m_(k-1) - m_(k+1)) x m_k.
    """
    total = sp.zeros(3, 1)
    for odd in range(first + 1, samples.fit.degree + 1, 2):
        below, above = _legendre_moment(samples, odd - 1), _legendre_moment(samples, odd + 1)
        polynomials, name = f"P{odd - 1}", f"moment_{odd - 1}"
        if any(above):
            polynomials, name = f"P{odd - 1} - P{odd + 1}", f"{name}_less_{odd + 1}"
        even = samples.combination(
            name,
            [a - b for a, b in zip(below, above, strict=True)],
            f"integral over the step of the rate times {polynomials}, Legendre polynomials",
        )
        half = samples.combination(
            f"half_moment_{odd}",
            [weight / 2 for weight in _legendre_moment(samples, odd)],
            f"half the integral over the step of the rate times P{odd}, a Legendre polynomial",
        )
        total -= _commutator(even, half)
    return total


def _commutator(a: sp.Matrix, b: sp.Matrix) -> sp.Matrix:
    """Return [a, b] for dC/dt = C skew(w): the source has dY/dt = A Y, whose transpose reverses every commutator."""
    return algebra.cross(b, a)


def _fourth(build: KernelBuilder, samples: Samples) -> sp.Matrix:
    b0 = _moment(samples, 0)
    if samples.fit.degree == 1:
        return b0 - _commutator(b0, _moment(samples, 1))
    return b0 + _second_order(samples, 0)


def _sixth(build: KernelBuilder, samples: Samples) -> sp.Matrix:
    def named(name: str, meaning: str, value: sp.Matrix) -> sp.Matrix:
        return build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), value)

    def alpha(number: int, meaning: str, *factors: sp.Expr) -> sp.Matrix:
        """Add a stage for a combination of the moments, which is linear in the samples."""
        moments = [samples.fit.moment(power) for power in range(3)]
        weights = [
            sum((f * w for f, w in zip(factors, column, strict=True)), sp.S.Zero)
            for column in zip(*moments, strict=True)
        ]
        return samples.combination(f"alpha_{number}", [sp.radsimp(sp.expand(w)) for w in weights], meaning)

    b0 = _moment(samples, 0)
    a1 = alpha(
        1, "rate at the middle of the step, times the step", sp.Rational(9, 4), sp.S.Zero, sp.Integer(-15)
    )
    a2 = alpha(2, "its first derivative, times the step squared", sp.S.Zero, sp.Integer(12), sp.S.Zero)
    a3 = alpha(
        3, "half of its second derivative, times the step cubed", sp.Integer(-15), sp.S.Zero, sp.Integer(180)
    )
    c1 = named("commutator_1", "[alpha_1, alpha_2]", _commutator(a1, a2))
    c2 = named("commutator_2", "-[alpha_1, 2 alpha_3 + commutator_1]/60", -_commutator(a1, 2 * a3 + c1) / 60)
    left = named("left", "left side of the last commutator", c1 - 20 * a1 - a3)
    # The three moments above hold the rate's Legendre polynomials up to the second degree.
    return b0 + _commutator(left, a2 + c2) / 240 + _second_order(samples, 2)
