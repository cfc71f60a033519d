"""Bounds the largest eigenvalue of a symmetric matrix of polynomials on a cube, in Bernstein form.

In this form a polynomial is a mean of its coefficients, whose weights are not negative; so is a matrix of polynomials.
Where a number exceeds the eigenvalues of all coefficients, it exceeds those of the matrix on the whole cube. Halving a
cube brings the coefficients closer to values of the matrix. They are integers, whose rounding is added to every bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Bits of the largest coefficient, and of a bound, so few that no rounding in the samples shows in it.
_BITS, _BOUND_BITS = 50, 10
#: How far above the largest value of the samples a bound may be: a part of that, and a part of the largest coefficient.
_ROOMS = (
    (Fraction(1, 32), Fraction(1, 1 << 36)),
    (Fraction(1, 8), Fraction(1, 1 << 24)),
    (Fraction(1, 2), Fraction(1, 1 << 12)),
)
#: Cubes after which a bound is given up, and the most coefficients that they may have together.
_MOST_CUBES, _MOST_COEFFICIENTS = 600, 6_000_000

#: The coefficients of a polynomial by the powers of its variables.
Powers = dict[tuple[int, ...], Fraction]
#: The ends of every side of a part of the unit cube.
Cube = tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True)
class _BernsteinForm:
    """Coefficients on a part of the unit cube: upper triangle, then a side for each variable."""

    coefficients: NDArray[np.int64]
    cube: Cube
    #: Units by which a true coefficient may be larger.
    slack: int

    @classmethod
    def of(cls, form: NDArray[Any], unit: Fraction) -> _BernsteinForm:
        """Return integers as multiples of a unit, rounded down, on the whole cube."""
        whole = ((Fraction(0), Fraction(1)),) * (form.ndim - 1)
        return cls((form * unit.denominator // unit.numerator).astype(np.int64), whole, 1)

    def is_below(self, limit: int) -> bool:
        """Tell whether the eigenvalues of all coefficients are below a limit: what they lack of it has none below 0.

        A matrix of n rows has none if the Cholesky decomposition in double succeeds after (n + 2) 2^-53 of its trace
        were subtracted from the diagonal (S. M. Rump, BIT 46 (2006) 433-452); here it is 2^-45 of it.
        """
        size = _size(len(self.coefficients))
        rows, columns = np.triu_indices(size)
        flat = self.coefficients.reshape(len(rows), -1)
        trace = size * (limit + (1 << _BITS))
        on_diagonal = limit - size * self.slack - (trace >> 45) - 1
        lack = np.zeros((flat.shape[1], size, size))
        lack[:, columns, rows] = (np.where(rows == columns, on_diagonal, 0)[:, None] - flat).T
        try:
            np.linalg.cholesky(lack)  # of the lower triangle
        except np.linalg.LinAlgError:
            return False
        return True

    def halves(self) -> list[_BernsteinForm]:
        """Return both halves of the cube, cut across its longest side, of equal ones the last."""
        lengths = [high - low for low, high in self.cube]
        side = max(range(len(lengths)), key=lambda k: (lengths[k], k))
        means = np.moveaxis(self.coefficients, side + 1, 0)
        lower, upper = np.empty_like(means), np.empty_like(means)
        for k in range(len(means)):
            lower[k], upper[-1 - k] = means[0], means[-1]
            means = (means[:-1] + means[1:]) >> 1
        low, high = self.cube[side]
        ends = ((low, (low + high) / 2), ((low + high) / 2, high))
        return [
            _BernsteinForm(
                np.moveaxis(half, 0, side + 1),
                (*self.cube[:side], end, *self.cube[side + 1 :]),
                self.slack + len(half),
            )
            for half, end in zip((lower, upper), ends, strict=True)
        ]


def eigenvalue_bounds(
    matrices: Sequence[Sequence[Sequence[Powers]]],
    samples: NDArray[np.float64],
    known: Fraction,
    is_outside: Callable[[Cube], bool] = lambda cube: False,
) -> tuple[Fraction, Fraction]:
    """Return two numbers of which no eigenvalue of symmetric matrices is below or above, and neither is 0.

    Parameters
    ----------
    matrices : sequence of matrix of Powers
        Polynomials in variables that lie from 0 to 1, in one number and order in all matrices.
    samples : array, shape (count, variables)
        Points at which eigenvalues hint how close bounds may be; no proof rests on them.
    known : Fraction
        Bound of the magnitude of eigenvalues, which is returned where no closer one is proved.
    is_outside : callable, optional
        Tells of a part of the cube whether the bounds need not hold in it.

    Returns
    -------
    tuple of Fraction
        Not above 0, and not below it.

    Examples
    --------
    The eigenvalues of [[0, x], [x, 0]] are x and -x.

    >>> zero, x = {}, {(1,): Fraction(1)}
    >>> low, high = eigenvalue_bounds([[[zero, x], [x, zero]]], np.array([[1.0]]), Fraction(7))
    >>> -1.04 < low <= -1, 1 <= high < 1.04
    (True, True)
    """
    forms = [_bernstein(matrix) for matrix in matrices]
    largest = max(Fraction(max(abs(value) for value in form.flat), common) for form, common in forms)
    if not largest:
        return Fraction(0), Fraction(0)
    unit = largest / (1 << _BITS)
    reached = np.array([_reached(form, unit * common, samples) for form, common in forms])
    low, high = (
        _bound(
            [_BernsteinForm.of(form * sign, unit * common) for form, common in forms],
            int(max(0, (sign * reached).max())),
            known / unit,
            is_outside,
        )
        for sign in (-1, 1)
    )
    return -low * unit, high * unit


def _bound(
    parts: Sequence[_BernsteinForm], reached: int, known: Fraction, is_outside: Callable[[Cube], bool]
) -> Fraction:
    """Return a number that is not below any eigenvalue, near the largest of the samples if that is proved."""
    for of_reached, of_largest in _ROOMS:
        limit = _short(math.ceil(reached * (1 + of_reached) + (1 << _BITS) * of_largest))
        if limit >= known:
            break
        if _is_below(parts, limit, is_outside):
            return Fraction(limit)
    return known


def _bernstein(matrix: Sequence[Sequence[Powers]]) -> tuple[NDArray[Any], int]:
    """Return the coefficients of the upper triangle in Bernstein form, element by variables, and their denominator."""
    elements = [matrix[i][j] for i in range(len(matrix)) for j in range(i, len(matrix))]
    sides = [max(powers) + 1 for powers in zip(*(powers for p in elements for powers in p), strict=True)]
    if not sides:
        sides = [1]
    common = math.lcm(*(c.denominator for p in elements for c in p.values()))
    form = np.zeros((len(elements), *sides), object)
    for element, polynomial in zip(form, elements, strict=True):
        for powers, coefficient in polynomial.items():
            element[powers] = int(coefficient * common)
    for axis, side in enumerate(sides, start=1):
        # x^i is the sum over j >= i of C(j, i) / C(n, i) times the polynomial j of the form of degree n.
        degree = side - 1
        scale = math.lcm(*(math.comb(degree, i) for i in range(side)))
        weights = [
            [math.comb(j, i) * scale // math.comb(degree, i) for i in range(side)] for j in range(side)
        ]
        form = np.moveaxis(np.tensordot(np.array(weights, object), form, axes=(1, axis)), 0, axis)
        common *= scale
    return form, common


def _reached(form: NDArray[Any], unit: Fraction, samples: NDArray[np.float64]) -> tuple[float, float]:
    """Return the smallest and the largest eigenvalue at points, in a unit."""
    values = (form * unit.denominator // unit.numerator).astype(np.float64)[None]
    for x in samples.T:
        degree = values.shape[2] - 1
        powers = np.arange(degree + 1)
        binomials = np.array([math.comb(degree, k) for k in powers], np.float64)
        basis = binomials * x[:, None] ** powers * (1 - x[:, None]) ** (degree - powers)
        values = np.einsum("pei...,pi->pe...", np.broadcast_to(values, (len(x), *values.shape[1:])), basis)
    size = _size(len(form))
    lower = np.zeros((len(samples), size, size))
    rows, columns = np.triu_indices(size)
    lower[:, columns, rows] = values  # numpy reads the lower triangle alone
    eigenvalues = np.linalg.eigvalsh(lower)
    return float(eigenvalues.min()), float(eigenvalues.max())


def _size(elements: int) -> int:
    """Return the number of rows of a matrix whose upper triangle has so many elements."""
    return (math.isqrt(8 * elements + 1) - 1) // 2


def _short(value: int) -> int:
    """Return an integer of few bits that is not below a positive one."""
    dropped = max(0, value.bit_length() - _BOUND_BITS)
    return -(-value >> dropped) << dropped


def _is_below(parts: Sequence[_BernsteinForm], limit: int, is_outside: Callable[[Cube], bool]) -> bool:
    """Tell whether all eigenvalues are proved to be below a limit; False after too many cubes."""
    pending = list(parts)
    left = min(_MOST_CUBES, _MOST_COEFFICIENTS // max(part.coefficients.size for part in parts))
    while pending:
        part = pending.pop()
        if is_outside(part.cube):
            continue
        if not left:
            return False
        left -= 1
        if not part.is_below(limit):
            pending += part.halves()
    return True
