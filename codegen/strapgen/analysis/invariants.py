"""Writes errors in vector-invariant form, as sums of vectors and cross products of the rate and its derivatives.

The form is not unique, because any four vectors, and their products, are linearly dependent. The result is the first
solution in the fixed order of terms of `Frame`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.symbolic.covariants import Coefficients, Decomposition, Frame
from strapgen.symbolic.evaluation import exact
from strapgen.symbolic.polynomials import Polynomial


@dataclass(frozen=True)
class Invariants:
    """The drift and the symmetric part of an error matrix at one power of the step.

    Parameters
    ----------
    drift : Coefficients
        Coefficients of the vectors i and of the cross products (i, j), where i is the i-th derivative of the rate; each
        a polynomial in scalar products.
    symmetric : Coefficients
        Coefficients of the unit matrix (), and of the symmetrized products a b' + b a': those of i and j as (i, j),
        those of i and j x k as (i, j, k).
    """

    drift: Coefficients
    symmetric: Coefficients


def invariants(
    frame: Frame, matrix: Sequence[Any], shown: Callable[[Fraction], Fraction] = Fraction
) -> Invariants:
    """Return an error matrix in vector-invariant form.

    Parameters
    ----------
    frame : Frame
    matrix : sequence of ring element
        Row by row, in the coordinates of the frame; over the rational numbers or a field of roots. In such a field
        each power of the generator is decomposed separately.
    shown : callable, optional
        Rounds a rational coefficient; coefficients that become zero are omitted.

    Returns
    -------
    Invariants

    Raises
    ------
    NotCovariantError
        If the matrix does not commute with rotations of the vectors.
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
    for power in range(domain.mod.degree()):
        share = domain.ext.as_expr() ** power
        decomposition = frame.matrix([_share(frame, element, power) for element in matrix])
        _add(drift, _scaled(decomposition.vector, -share))
        _add(symmetric, _scaled(decomposition.symmetric, share))
    return Invariants(drift, symmetric)


def _rounded(coefficients: Coefficients, shown: Callable[[Fraction], Fraction]) -> Coefficients:
    rounded = {
        c: {m: shown(x) for m, x in polynomial.items() if shown(x)} for c, polynomial in coefficients.items()
    }
    return {c: polynomial for c, polynomial in rounded.items() if polynomial}


def _share(frame: Frame, element: Any, power: int) -> Any:
    """Return the rational polynomial that multiplies a power of the generator of a field of roots."""
    terms = {}
    for place, number in element.terms():
        numbers = number.to_list()[::-1]
        if power < len(numbers) and numbers[power]:
            terms[place] = numbers[power]
    return frame.ring.from_dict(terms)


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

    Parameters
    ----------
    frame : Frame
    element : ring element
        The scalar in the coordinates of the frame, over the rational numbers or a field of roots.
    """
    domain = element.ring.domain
    if domain == sp.QQ:
        return frame.quaternion([frame.ring.zero] * 3, element).scalar or {}
    total: Coefficients = {}
    for power in range(domain.mod.degree()):
        part = frame.quaternion([frame.ring.zero] * 3, _share(frame, element, power)).scalar or {}
        _add(total, _scaled({(): part}, domain.ext.as_expr() ** power))
    return total.get((), {})


def vector(frame: Frame, elements: Sequence[Any]) -> Coefficients:
    """Return a vector as a sum of vectors and cross products.

    Parameters
    ----------
    frame : Frame
    elements : sequence of ring element
        The vector in the coordinates of the frame, over the rational numbers or a field of roots.

    Raises
    ------
    NotCovariantError
        If it does not commute with rotations of the vectors of the frame.
    """
    domain = elements[0].ring.domain
    if domain == sp.QQ:
        return frame.quaternion(list(elements), frame.ring.zero).vector
    total: Coefficients = {}
    for power in range(domain.mod.degree()):
        shares = [_share(frame, element, power) for element in elements]
        part = frame.quaternion(shares, frame.ring.zero).vector
        _add(total, _scaled(part, domain.ext.as_expr() ** power))
    return total


def scalar_value(polynomial: Polynomial, vectors: Sequence[Sequence[Any]]) -> Any:
    """Return the value of a polynomial in scalar products for vectors of numbers, symbols or polynomials."""
    return Decomposition(polynomial, {}, {}).evaluate([list(vector) for vector in vectors])[3]
