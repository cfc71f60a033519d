"""The rotation vector of a step as a series in the rate: its terms of first, second, third and higher order.

Bortz's equation is integrated term by term for a rate that is a sum of vectors, each times a function of time. Its
terms are sums of nested cross products a x (b x (c x d)); such a product is a word, the tuple of the numbers of its
vectors, from left to right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.catalogue import rates
from strapgen.catalogue.munthe_kaas import bortz_coefficient

SOURCE = "W. Magnus, Commun. Pure Appl. Math. 7 (1954) 649-673; K.-T. Chen, Ann. Math. 65 (1957) 163-178"

#: A vector of a sum by its number; nested cross products of such vectors, and the coefficient of each.
Word = tuple[int, ...]
Words = dict[Word, Fraction]
#: Coefficients of scalar products, and of a vector or a cross product each times those.
Scalars = dict[tuple[int, int], Fraction]


@cache
def terms(vectors: int, order: int) -> tuple[Words, ...]:
    """Return the terms of first to given order for the rate sum_j r_j t^j, the step being from time 0 to 1.

    dphi/dt = sum_k b_k phi x (phi x ... w), k products, is solved order by order in the rate w: what stands on the
    right in the order m is made of terms of lower orders alone.

    Parameters
    ----------
    vectors : int
        Number of the vectors r_0, r_1, ...
    order : int

    Returns
    -------
    tuple of dict
        For every order its words in the r_j.

    Examples
    --------
    >>> first, second = terms(2, 2)
    >>> first, second[0, 1] - second[1, 0]
    ({(0,): Fraction(1, 1), (1,): Fraction(1, 2)}, Fraction(1, 12))
    """
    rate: Words = {(j,): Fraction(1) for j in range(vectors)}
    found = [_integral(rate)]
    nested: list[dict[int, Words]] = [{1: rate}]  # for k products their parts of every order
    for m in range(2, order + 1):
        derivative: Words = {}
        for k in range(1, m):
            if k == len(nested):
                nested.append({})
            part: Words = {}
            for a in range(1, m):
                if m - a in nested[k - 1]:
                    _add(part, cross(found[a - 1], nested[k - 1][m - a]))
            nested[k][m] = part
            b = bortz_coefficient(k)
            _add(derivative, part, Fraction(int(b.p), int(b.q)))
        found.append(_integral(derivative))
    return tuple(found)


@cache
def legendre_terms(vectors: int, order: int) -> tuple[Words, ...]:
    """Return the terms for the rate sum_m l_m P_m, P_m the Legendre polynomials of the step.

    Parameters and result are as in `terms`. Here many coefficients vanish: reversing time changes the sign of the
    rotation vector.
    """
    table = [
        {m: fraction(rates.legendre(m)[j]) for m in range(j, vectors)} for j in range(vectors)
    ]  # r_j in the l_m
    return tuple(substituted(words, table) for words in terms(vectors, order))


def substituted(words: Words, table: Sequence[Mapping[int, Fraction]]) -> Words:
    """Return words with each of their vectors replaced by a sum of others.

    Parameters
    ----------
    words : dict
    table : sequence of mapping
        For every vector the coefficients of others in it.
    """
    length = max(map(len, words), default=0)
    for place in range(length):
        replaced: Words = {}
        for word, c in words.items():
            for other, weight in table[word[place]].items():
                _add(replaced, {(*word[:place], other, *word[place + 1 :]): c * weight})
        words = {word: c for word, c in replaced.items() if c}
    return words


def in_samples(terms: Words, increments: int, previous: int = 0) -> Words:
    """Return a term in r_0, r_1, ... in the samples whose polynomial the rate is.

    Parameters
    ----------
    terms : dict
        Of `terms`, for as many vectors as there are samples.
    increments, previous : int
        Samples of the step, and those before it.
    """
    fit = rates.from_increments(increments, previous)
    return substituted(
        terms,
        [{k: fraction(w) for k, w in enumerate(fit.taylor(j))} for j in range(increments + previous)],
    )


def cross(left: Words, right: Words) -> Words:
    """Return the cross product of two sums of words, as a sum of words.

    Examples
    --------
    >>> cross({(0, 1): Fraction(1)}, {(2,): Fraction(1)})  # (a x b) x c = a x (b x c) - b x (a x c)
    {(0, 1, 2): Fraction(1, 1), (1, 0, 2): Fraction(-1, 1)}
    """
    product: Words = {}
    for word, a in left.items():
        for other, b in right.items():
            _add(product, _product(word, other), a * b)
    return product


def pairs(words: Words) -> Scalars:
    """Return words of two vectors as coefficients of r_i x r_j, i < j."""
    found: Words = {}
    for (i, j), c in words.items():
        if i != j:
            _add(found, {(min(i, j), max(i, j)): c if i < j else -c})
    return {(i, j): c for (i, j), c in sorted(found.items()) if c}


def third(words: Words) -> dict[int, Scalars]:
    """Return words of three vectors as vectors r_k, each times a sum of scalar products r_i . r_j, i <= j.

    a x (b x c) = b (a . c) - c (a . b). The vectors being any, the coefficients are unique.

    Returns
    -------
    dict
        For k the coefficients of the scalar products, by (i, j).
    """
    found: dict[int, Scalars] = {}
    for (a, b, c), weight in words.items():
        _collect(found.setdefault(b, {}), a, c, weight)
        _collect(found.setdefault(c, {}), a, b, -weight)
    return {k: weights for k, row in sorted(found.items()) if (weights := _nonzero(row))}


def fourth(words: Words) -> dict[tuple[int, int], Scalars]:
    """Return words of four vectors as products r_k x r_l, k < l, each times a sum of scalar products r_i . r_j.

    a x (b x (c x d)) = (b . d) a x c - (b . c) a x d. The vectors being any, the coefficients are unique.

    Returns
    -------
    dict
        For (k, l) the coefficients of the scalar products, by (i, j), i <= j.
    """
    found: dict[tuple[int, int], Scalars] = {}
    for (a, b, c, d), weight in words.items():
        for left, other, sign in ((c, d, 1), (d, c, -1)):
            if left != a:
                key, turned = (min(a, left), max(a, left)), sign if a < left else -sign
                _collect(found.setdefault(key, {}), b, other, turned * weight)
    return {key: weights for key, row in sorted(found.items()) if (weights := _nonzero(row))}


def fraction(number: sp.Expr) -> Fraction:
    """Return a rational number of SymPy as a fraction."""
    return Fraction(int(number.p), int(number.q))


def _product(word: Word, other: Word) -> Words:
    """Return the cross product of two words: (a x p) x q = a x (p x q) - p x (a x q), a one vector."""
    if len(word) == 1:
        return {} if word == other else {word + other: Fraction(1)}
    head, rest = word[:1], word[1:]
    found: Words = {head + inner: c for inner, c in _product(rest, other).items()}
    _add(found, _product(rest, head + other), Fraction(-1))
    return found


def _integral(words: Words) -> Words:
    """Integrate from 0 to 1 what stands for t to the power of sum (j + 1) - 1, j the vectors of a word.

    Kept as the coefficient of the next power: what a later term needs of the integral to any time.
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
