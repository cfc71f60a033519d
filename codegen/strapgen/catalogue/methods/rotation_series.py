"""The rotation vector of a step as a series in the rate, with terms of first, second and higher order.

Bortz's equation is integrated term by term for a rate that is a sum of vectors, each times a function of time. The
terms are sums of nested cross products a x (b x (c x d)). Such a product is a word: the tuple of the numbers of its
vectors, from left to right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.munthe_kaas import bortz_coefficient

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
                    _add(part, cross(solved[a - 1], nested[k - 1][m - a]))
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
    """Return a term in r_0, r_1, ... as a term in the samples through which the polynomial rate goes."""
    fit = rate_fit.from_increments(increments, previous)
    return substituted(
        terms,
        [{k: fraction(w) for k, w in enumerate(fit.taylor(j))} for j in range(increments + previous)],
    )


def cross(left: Words, right: Words) -> Words:
    """Return the cross product of two sums of words, as a sum of words.

    >>> cross({(0, 1): Fraction(1)}, {(2,): Fraction(1)})  # (a x b) x c = a x (b x c) - b x (a x c)
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


def third(words: Words) -> dict[int, Scalars]:
    """Return words of three vectors as vectors r_k, each times a sum of scalar products r_i . r_j, i <= j.

    It uses a x (b x c) = b (a . c) - c (a . b). The coefficients are unique, since the vectors are arbitrary.
    """
    collected: dict[int, Scalars] = {}
    for (a, b, c), weight in words.items():
        _collect(collected.setdefault(b, {}), a, c, weight)
        _collect(collected.setdefault(c, {}), a, b, -weight)
    return {k: weights for k, row in sorted(collected.items()) if (weights := _nonzero(row))}


def fourth(words: Words) -> dict[tuple[int, int], Scalars]:
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
