"""Writes errors in vector-invariant form, as sums of vectors and cross products of the rate and its derivatives.

The form is not unique, because any four vectors, and their products, are linearly dependent. The result is the first
solution in the fixed order of terms of `Frame`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Coefficients, Decomposition, Frame
from strapgen.kernel.polynomials import Polynomial


@dataclass(frozen=True)
class Invariants:
    """The drift and the symmetric part of an error matrix at one power of the step."""

    #: Coefficients of the vectors i and of the cross products (i, j), where i is the i-th derivative of the
    #: rate; each a polynomial in scalar products
    drift: Coefficients
    #: Coefficients of the unit matrix (), and of the symmetrized products a b' + b a': those of i and j as (i,
    #: j), those of i and j x k as (i, j, k)
    symmetric: Coefficients


def invariants(
    frame: Frame, matrix: Sequence[Any], shown: Callable[[Fraction], Fraction] = Fraction
) -> Invariants:
    """Return an error matrix in vector-invariant form.

    `matrix`: row by row, in the coordinates of the frame; over the rational numbers or a field of roots. In
    such a field each power of the generator is decomposed separately.
    """
    domain = matrix[0].ring.domain
    if domain == sp.QQ:
        decomposition = frame.matrix(list(matrix))
        return Invariants(
            _scaled(_rounded(decomposition.vector, shown), Fraction(-1)),
            _rounded(decomposition.symmetric, shown),
        )
    drift: Coefficients = {}
    symmetric: Coefficients = {}
    for share, elements in _shares(frame, matrix):
        decomposition = frame.matrix(elements)
        _add(drift, _scaled(decomposition.vector, -share))
        _add(symmetric, _scaled(decomposition.symmetric, share))
    return Invariants(_without_zeros(drift), _without_zeros(symmetric))


def _rounded(coefficients: Coefficients, shown: Callable[[Fraction], Fraction]) -> Coefficients:
    rounded = {
        c: {m: shown(x) for m, x in polynomial.items() if shown(x)} for c, polynomial in coefficients.items()
    }
    return {c: polynomial for c, polynomial in rounded.items() if polynomial}


def _shares(frame: Frame, elements: Sequence[Any]) -> list[tuple[sp.Expr, list[Any]]]:
    """Return elements as sums of rational ones, each times an expression in roots and unknowns."""
    domain, divisor = elements[0].ring.domain, sp.S.One
    coefficients = [dict(element.terms()) for element in elements]
    if domain.is_Frac:  # all quotients get one divisor
        common = domain.get_ring().one
        for quotient in (c for row in coefficients for c in row.values()):
            common = common.lcm(quotient.denom)
        divisor, domain = common.as_expr(), domain.get_ring()
        coefficients = [
            {place: c.numer * common.exquo(c.denom) for place, c in row.items()} for row in coefficients
        ]
    terms: dict[sp.Expr, list[dict[Any, Any]]] = {}
    for number, row in enumerate(coefficients):
        for place, coefficient in row.items():
            for share, rational in _rational_parts(domain, coefficient):
                terms.setdefault(share / divisor, [{} for _ in elements])[number][place] = rational
    return [(share, [frame.ring.from_dict(row) for row in rows]) for share, rows in terms.items()]


def _rational_parts(domain: Any, number: Any) -> Iterator[tuple[sp.Expr, Any]]:
    """Yield what a number of a domain is the sum of: expressions in its generators, and their rational factors."""
    if domain.is_Poly:
        for exponents, coefficient in number.terms():
            product = sp.Mul(*(x**k for x, k in zip(domain.symbols, exponents, strict=True)))
            for share, rational in _rational_parts(domain.domain, coefficient):
                yield share * product, rational
    elif domain == sp.QQ:
        yield sp.S.One, number
    else:
        for power, rational in enumerate(number.to_list()[::-1]):
            if rational:
                yield domain.ext.as_expr() ** power, rational


def _without_zeros(coefficients: Coefficients) -> Coefficients:
    """Return coefficients without those whose parts cancel, which they may if they are quotients."""
    simple = {
        c: {m: exact(x) if exact(x).is_polynomial() else sp.cancel(x) for m, x in row.items()}
        for c, row in coefficients.items()
    }
    simple = {c: {m: x for m, x in row.items() if x != 0} for c, row in simple.items()}
    return {c: row for c, row in simple.items() if row}


def _add(total: Coefficients, more: Coefficients) -> None:
    for covariant, polynomial in more.items():
        sums = total.setdefault(covariant, {})
        for monomial, number in polynomial.items():
            sums[monomial] = sums[monomial] + number if monomial in sums else number


def _scaled(coefficients: Coefficients, factor: Any) -> Coefficients:
    return {
        c: {
            m: x * factor if isinstance(factor, Fraction) else exact(x) * factor
            for m, x in polynomial.items()
        }
        for c, polynomial in coefficients.items()
    }


def matrix(parts: Invariants, vectors: Sequence[Sequence[Any]]) -> list[Any]:
    """Return the error matrix row by row for vectors of numbers, symbols or polynomials."""
    return Decomposition(None, _scaled(parts.drift, Fraction(-1)), parts.symmetric).evaluate(
        [list(vector) for vector in vectors]
    )


def scalar(frame: Frame, element: Any) -> Polynomial:
    """Return a scalar as a polynomial in scalar products.

    `element`: the scalar in the coordinates of the frame, over the rational numbers or a field of roots.
    """
    domain = element.ring.domain
    if domain == sp.QQ:
        return frame.quaternion([frame.ring.zero] * 3, element).scalar or {}
    total: Coefficients = {}
    for share, (rational,) in _shares(frame, [element]):
        part = frame.quaternion([frame.ring.zero] * 3, rational).scalar or {}
        _add(total, _scaled({(): part}, share))
    return _without_zeros(total).get((), {})


def vector(frame: Frame, elements: Sequence[Any]) -> Coefficients:
    """Return a vector as a sum of vectors and cross products.

    `elements`: the vector in the coordinates of the frame, over the rational numbers or a field of roots.
    """
    domain = elements[0].ring.domain
    if domain == sp.QQ:
        return frame.quaternion(list(elements), frame.ring.zero).vector
    total: Coefficients = {}
    for share, rationals in _shares(frame, elements):
        _add(total, _scaled(frame.quaternion(rationals, frame.ring.zero).vector, share))
    return _without_zeros(total)


def scalar_value(polynomial: Polynomial, vectors: Sequence[Sequence[Any]]) -> Any:
    """Return the value of a polynomial in scalar products for vectors of numbers, symbols or polynomials."""
    return Decomposition(polynomial, {}, {}).evaluate([list(vector) for vector in vectors])[3]
