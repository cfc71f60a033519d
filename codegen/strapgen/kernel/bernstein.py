"""Bounds of the eigenvalues of a symmetric matrix of polynomials on a cube, in Bernstein form.

In this form a polynomial is a mean of its coefficients, whose weights are not negative; so is a matrix of polynomials.
Where a number exceeds the eigenvalues of all coefficients, it exceeds those of the matrix on the whole cube. Halving a
cube brings the coefficients closer to values of the matrix. They are integers, whose rounding is added to every bound.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Bits of the largest coefficient, and of a bound, so few that no rounding in the samples shows in it.
_BITS, _BOUND_BITS = 50, 10
#: Margins of a bound above the largest value of the samples: a part of that, and a part of the largest coefficient.
_ROOMS = (
    (Fraction(1, 32), Fraction(1, 1 << 36)),
    (Fraction(1, 8), Fraction(1, 1 << 24)),
    (Fraction(1, 2), Fraction(1, 1 << 12)),
)
#: Cubes after which a bound is given up, and the most coefficients that they may have together.
_MOST_CUBES, _MOST_COEFFICIENTS = 600, 6_000_000

#: The coefficients of a polynomial by the powers of its variables.
Powers = dict[tuple[int, ...], Fraction]
#: The ends of every side of a part of the unit cube: a few halvings, exact in double.
Cube = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class _BernsteinForms:
    """Coefficients on equal parts of the unit cube: a part, the upper triangle, then a side for each variable."""

    coefficients: NDArray[np.int64]
    cubes: list[Cube]
    slack: int  # units by which a true coefficient may be larger

    @classmethod
    def of(cls, form: NDArray[Any], unit: Fraction) -> _BernsteinForms:
        """Return a form on the whole cube in integer multiples of a unit, rounded down."""
        whole = ((0.0, 1.0),) * (form.ndim - 1)
        return cls((form * unit.denominator // unit.numerator).astype(np.int64)[None], [whole], 1)

    def are_below(self, limit: int) -> NDArray[np.bool_]:
        """Return for each part whether all eigenvalues of its coefficients are proved to lie below `limit`.

        The matrix limit - form of n rows is positive if its Cholesky decomposition in double succeeds after
        (n + 2) 2^-53 of the trace were subtracted from the diagonal (S. M. Rump, BIT 46 (2006) 433-452); here it is
        2^-45 of it.
        """
        parts, elements = self.coefficients.shape[:2]
        size = _size(elements)
        flat = self.coefficients.reshape(parts, elements, -1)
        trace = size * (limit + (1 << _BITS))
        on_diagonal = limit - size * self.slack - (trace >> 45) - 1
        upper = {place: flat[:, number] for number, place in enumerate(_upper_triangle(size))}
        root: dict[tuple[int, int], NDArray[np.float64]] = {}
        succeeds = np.ones(flat[:, 0].shape, bool)
        for j in range(size):
            for i in range(j, size):
                left = ((on_diagonal if i == j else 0) - upper[j, i]).astype(np.float64)
                for k in range(j):
                    left -= root[i, k] * root[j, k]
                if i == j:
                    succeeds &= left > 0
                    root[j, j] = np.sqrt(np.where(succeeds, left, 1))
                else:
                    root[i, j] = left / root[j, j]
        return np.asarray(succeeds.all(axis=1))

    def halves(self) -> _BernsteinForms:
        """Return both halves of every part, cut across its longest side, of equal ones the last."""
        lengths = [high - low for low, high in self.cubes[0]]
        side = max(range(len(lengths)), key=lambda k: (lengths[k], k))
        means = np.moveaxis(self.coefficients, side + 2, 0)
        lower, upper = np.empty_like(means), np.empty_like(means)
        for k in range(len(means)):
            lower[k], upper[-1 - k] = means[0], means[-1]
            means = (means[:-1] + means[1:]) >> 1
        ends = ((low, (low + high) / 2, high) for low, high in (cube[side] for cube in self.cubes))
        cuts = [((low, middle), (middle, high)) for low, middle, high in ends]
        return _BernsteinForms(
            np.concatenate([np.moveaxis(half, 0, side + 2) for half in (lower, upper)]),
            [
                (*cube[:side], cut[which], *cube[side + 1 :])
                for which in (0, 1)
                for cube, cut in zip(self.cubes, cuts, strict=True)
            ],
            self.slack + len(lower),
        )

    def chosen(self, which: NDArray[np.bool_]) -> _BernsteinForms:
        cubes = [cube for cube, one in zip(self.cubes, which, strict=True) if one]
        return _BernsteinForms(self.coefficients[which], cubes, self.slack)


def eigenvalue_bounds(
    matrices: Sequence[Sequence[Sequence[Powers]]],
    samples: NDArray[np.float64],
    known: Fraction,
    is_outside: Callable[[Cube], bool] = lambda cube: False,
) -> tuple[Fraction, Fraction]:
    """Return a lower bound <= 0 and an upper bound >= 0 of all eigenvalues of symmetric matrices on the unit cube.

    The matrices have polynomials in the same variables. Eigenvalues at the `samples`, (count, variables), show how
    close the bounds may be; no proof rests on them. Where no bound is proved, `known` bounds their magnitude. Parts of
    the cube that `is_outside` names are left out.

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
    reached = np.array([_sampled_eigenvalues(form, unit * common, samples) for form, common in forms])
    low, high = (
        _bound(
            [_BernsteinForms.of(form * sign, unit * common) for form, common in forms],
            int(max(0, (sign * reached).max())),
            known / unit,
            is_outside,
        )
        for sign in (-1, 1)
    )
    return -low * unit, high * unit


def _bound(
    wholes: Sequence[_BernsteinForms], reached: int, known: Fraction, is_outside: Callable[[Cube], bool]
) -> Fraction:
    """Return an upper bound of the eigenvalues, near the largest of the samples if that is proved, else `known`."""
    for of_reached, of_largest in _ROOMS:
        limit = _short(math.ceil(reached * (1 + of_reached) + (1 << _BITS) * of_largest))
        if limit >= known:
            break
        if _is_below(wholes, limit, is_outside):
            return Fraction(limit)
    return known


def _bernstein(matrix: Sequence[Sequence[Powers]]) -> tuple[NDArray[Any], int]:
    """Return the Bernstein coefficients of the upper triangle, element by variables, and their denominator."""
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


def _sampled_eigenvalues(
    form: NDArray[Any], unit: Fraction, samples: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the smallest and the largest eigenvalue at sample points, as multiples of a unit."""
    values = (form * unit.denominator // unit.numerator).astype(np.float64)[None]
    for x in samples.T:
        degree = values.shape[2] - 1
        powers = np.arange(degree + 1)
        binomials = np.array([math.comb(degree, k) for k in powers], np.float64)
        points, place = np.unique(x, return_inverse=True)
        basis = binomials * points[:, None] ** powers * (1 - points[:, None]) ** (degree - powers)
        if len(values) == 1:  # the same at all points so far
            values = np.einsum("ei...,pi->pe...", values[0], basis)[place]
        else:
            values = np.einsum("pei...,pi->pe...", values, basis[place])
    size = _size(len(form))
    lower = np.zeros((len(samples), size, size))
    rows, columns = np.triu_indices(size)
    lower[:, columns, rows] = values  # numpy reads the lower triangle alone
    eigenvalues = np.linalg.eigvalsh(lower)
    return float(eigenvalues.min()), float(eigenvalues.max())


@cache
def _upper_triangle(size: int) -> list[tuple[int, int]]:
    return list(itertools.combinations_with_replacement(range(size), 2))


def _size(elements: int) -> int:
    """Return the number of rows of a matrix from the number of elements of its upper triangle."""
    return (math.isqrt(8 * elements + 1) - 1) // 2


def _short(value: int) -> int:
    """Round a positive integer up to one of few significant bits."""
    dropped = max(0, value.bit_length() - _BOUND_BITS)
    return -(-value >> dropped) << dropped


def _is_below(wholes: Sequence[_BernsteinForms], limit: int, is_outside: Callable[[Cube], bool]) -> bool:
    """Return whether all eigenvalues are proved to be below a limit; False after too many cubes."""
    left = min(_MOST_CUBES, _MOST_COEFFICIENTS // max(whole.coefficients.size for whole in wholes))
    for parts in wholes:
        while True:
            parts = parts.chosen(np.array([not is_outside(cube) for cube in parts.cubes], bool))
            if not parts.cubes:
                break
            left -= len(parts.cubes)
            if left < 0:
                return False
            pending = ~parts.are_below(limit)
            if not pending.any():
                break
            parts = parts.chosen(pending).halves()
    return True
