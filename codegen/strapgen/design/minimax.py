"""Symmetric filters of the least largest error over a band, by exchange from a linear programme.

The programme on a grid tells where the largest errors lie; from there the exchange of Remez finds the filter in many
digits. Only these decide, so that a design is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import groupby
from math import isqrt
from operator import mul
from typing import Any, NamedTuple

from strapgen.design.band_grid import (
    BITS,
    REAL,
    SEARCH_POINTS,
    BandGrid,
    bessel,
    integer,
    mean_points,
    search_grid,
)
from strapgen.design.mean_square import solve
from strapgen.design.unknowns import Unknowns
from strapgen.support.exceptions import InputError, MissingExtraError

#: Change of the level, by itself, at which the exchange ends, and most rounds of it.
_STABLE, _MOST_ROUNDS = Fraction(1, 10**22), 40
#: Largest part of the level by which the largest error may exceed it in the end.
_EXCESS = Fraction(1, 10**9)
#: Steps of Newton's method for an extremum; each doubles the digits, of which the grid gives three.
_NEWTON_STEPS = 6


class Minimax(NamedTuple):
    """A filter of the least largest error.

    Parameters
    ----------
    taps : tuple of mpf, (p + 1 + L)
        The oldest first.
    level : mpf
        The largest error, for each unit of rate times the sampling interval.
    """

    taps: tuple[Any, ...]
    level: Any


def design(unknowns: Unknowns, band: Fraction, points: int = SEARCH_POINTS) -> Minimax:
    """Return the filter of the least largest error over a band under its conditions.

    Parameters
    ----------
    unknowns : Unknowns
        Those of a symmetric or antisymmetric filter.
    band : Fraction
        Highest angular frequency in rad a sample.
    points : int, optional
        Frequencies of the grid on which the largest errors are searched, before they are refined.

    Returns
    -------
    Minimax

    Raises
    ------
    MissingExtraError
        If SciPy is not installed.
    InputError
        If the exchange does not converge.

    Examples
    --------
    >>> from strapgen.design.unknowns import Shape
    >>> filter = design(Unknowns(Shape(3, 3, 4), 1), Fraction(13, 10))
    >>> [round(float(tap), 12) for tap in filter.taps[4:]], f"{float(filter.level):.6e}"
    ([0.408856141152, -0.099584912922, 0.013437894897], '2.160751e-03')
    """
    grid = search_grid(band, unknowns.shape.previous, None, points)
    problem = _Problem(unknowns, grid)
    if not unknowns.free:
        errors = problem.errors([])
        return Minimax(problem.taps([]), REAL.ldexp(REAL.mpf(max(map(abs, errors))), -BITS))
    reference = _start(unknowns, band)
    previous = None
    for _ in range(_MOST_ROUNDS):
        free, level = problem.levelled(reference)
        errors = problem.errors(free)
        places = alternating(errors, unknowns.free + 1)
        if places is None:
            break
        reference = [problem.refined(place, free) for place in places]
        if previous is not None and abs(level - previous) * _STABLE.denominator <= level:
            largest = max(map(abs, errors))
            if largest * _EXCESS.denominator > integer(level) * (_EXCESS.denominator + 1):
                break
            return Minimax(problem.taps(free), level)
        previous = level
    raise InputError(
        f"the filter of c_{unknowns.m} over {float(band):g} rad a sample does not converge; "
        "a wider band or fewer samples are needed"
    )


class _Problem:
    """The error of a filter as a function of its free unknowns, on a grid and at any frequency."""

    def __init__(self, unknowns: Unknowns, grid: BandGrid) -> None:
        self._unknowns = unknowns
        self._grid = grid
        self._distances = [abs(group[0][0] - unknowns.shape.previous) for group in unknowns.groups]
        self._base = unknowns.complete([Fraction(0)] * unknowns.free)
        self._directions, self.right = columns(unknowns, grid)
        self._rows = list(zip(*self._directions, strict=True))

    def values(self, free: Sequence[Any]) -> list[Any]:
        """Return all unknowns in many digits."""
        values = [REAL.mpf(x.numerator) / x.denominator for x in self._base]
        for value, direction in zip(free, self._unknowns.directions, strict=True):
            values = [x + value * d.numerator / d.denominator for x, d in zip(values, direction, strict=True)]
        return values

    def taps(self, free: Sequence[Any]) -> tuple[Any, ...]:
        """Return the taps."""
        return self._unknowns.taps(self.values(free))

    def errors(self, free: Sequence[Any]) -> list[int]:
        """Return the errors on the grid."""
        if not free:
            return self.right
        weights = [integer(value) for value in free]
        return [
            value - (sum(map(mul, weights, row)) >> BITS)
            for value, row in zip(self.right, self._rows, strict=True)
        ]

    def levelled(self, reference: Sequence[Any]) -> tuple[list[Any], Any]:
        """Return the free unknowns whose errors at some frequencies alternate and are equally large, and how large."""
        grid = BandGrid(reference, self._unknowns.shape.previous)
        directions, right = columns(self._unknowns, grid)
        matrix = [
            [*(REAL.ldexp(REAL.mpf(column[i]), -BITS) for column in directions), REAL.mpf((-1) ** i)]
            for i in range(len(reference))
        ]
        (solution,) = solve(matrix, [[REAL.ldexp(REAL.mpf(value), -BITS) for value in right]])
        return solution[:-1], abs(solution[-1])

    def refined(self, place: int, free: Sequence[Any]) -> Any:
        """Return the frequency of the extremum of the error next to a point of the grid."""
        points = self._grid.points
        if place == len(points) - 1 or place == 0:
            return points[place]
        values = self.values(free)
        b = points[place]
        for _ in range(_NEWTON_STEPS):
            slope, curvature = self._derivatives(b, values)
            b = min(max(b - slope / curvature, points[place - 1]), points[place + 1])
        return b

    def _derivatives(self, b: Any, values: Sequence[Any]) -> tuple[Any, Any]:
        """Return the first two derivatives of (+-)(2m + 1) j_m(b/2) - s(b) sum F_j (1, 2 cos jb or 2 sin jb)."""
        m = self._unknowns.m
        total = slope = curvature = REAL.mpf(0)
        for j, x in zip(self._distances, values, strict=True):
            cosine, sine = REAL.cos_sin(j * b)
            value, derivative = (sine, j * cosine) if m % 2 else (cosine, -j * sine)
            weight = 2 * x if j else x
            total, slope = total + weight * value, slope + weight * derivative
            curvature -= weight * j * j * value
        s, s1, s2 = bessel(0, b)
        _, right1, right2 = bessel(m, b)
        factor = (-1) ** (m // 2) * (2 * m + 1)
        return (
            factor * right1 - s1 * total - s * slope,
            factor * right2 - s2 * total - 2 * s1 * slope - s * curvature,
        )


def columns(unknowns: Unknowns, grid: BandGrid) -> tuple[list[list[int]], list[int]]:
    """Return what a unit of each free unknown answers on a grid, and what they have to answer together.

    Parameters
    ----------
    unknowns : Unknowns
        Those of a symmetric or antisymmetric filter, whose answers are real.
    grid : BandGrid

    Returns
    -------
    list of list of int, (free, points)
    list of int, (points,)
    """
    tables = grid.sines if unknowns.m % 2 else grid.cosines
    single = []
    for group in unknowns.groups:
        j = abs(group[0][0] - unknowns.shape.previous)
        single.append(
            [len(group) * gain * row[j] >> BITS for (gain, _), row in zip(grid.gains, tables, strict=True)]
        )
    rows = list(zip(*single, strict=True))
    directions = [
        [sum(map(mul, weights, row)) >> BITS for row in rows]
        for weights in ([integer(x) for x in direction] for direction in unknowns.directions)
    ]
    base = [integer(x) for x in unknowns.complete([Fraction(0)] * unknowns.free)]
    right = [
        value - (sum(map(mul, base, row)) >> BITS)
        for value, row in zip(grid.bessel(unknowns.m), rows, strict=True)
    ]
    return directions, right


def alternating(errors: Sequence[Any], count: int) -> list[int] | None:
    """Return the places of so many largest errors of alternating sign; None if the sign alternates too seldom.

    Examples
    --------
    >>> alternating([0, 3, 1, -2, -3, 2, -1], 3), alternating([1, 2, -1], 3)
    ([1, 4, 5], None)
    """
    places = []
    for sign, run in groupby(range(len(errors)), key=lambda k: (errors[k] > 0) - (errors[k] < 0)):
        if sign:
            places.append(max(run, key=lambda k: abs(errors[k])))
    runs = [places[k : k + count] for k in range(len(places) - count + 1)]
    if not runs:
        return None
    return max(runs, key=lambda run: min(abs(errors[k]) for k in run))


def _start(unknowns: Unknowns, band: Fraction) -> list[Any]:
    """Return frequencies at which a linear programme has its largest errors."""
    points = sorted(mean_points(band))
    grid = BandGrid(points, unknowns.shape.previous)
    directions, right = columns(unknowns, grid)
    errors = _programme(*_orthonormal(directions, right))
    places = alternating(errors, unknowns.free + 1)
    if places is None:
        raise InputError(
            f"the filter of c_{unknowns.m} over {float(band):g} rad a sample is beyond the digits of the search; "
            "a wider band or fewer samples are needed"
        )
    return [points[k] for k in places]


def _orthonormal(directions: list[list[int]], right: list[int]) -> tuple[list[list[float]], list[float]]:
    """Return orthonormal columns and what they leave of the right side, scaled to at most 1, in double precision."""
    basis: list[list[int]] = []
    for column in [*directions, right]:
        for other in basis * 2:
            share = sum(map(mul, column, other)) >> BITS
            column = [a - (share * b >> BITS) for a, b in zip(column, other, strict=True)]
        if len(basis) < len(directions):
            length = isqrt(sum(value * value for value in column))
            if length >> (BITS // 4) == 0:
                raise InputError(
                    "the band is too narrow, or the samples are too many, for a filter to be the best one"
                )
            column = [(value << BITS) // length for value in column]
            basis.append(column)
    largest = max(map(abs, column)) or 1
    scale = isqrt(len(right))
    return (
        [[value * scale / (1 << BITS) for value in other] for other in basis],
        [value / largest for value in column],
    )


def _programme(basis: list[list[float]], right: list[float]) -> list[float]:
    """Return the errors of the linear programme min s, |right - basis z| <= s."""
    try:
        from scipy.optimize import linprog
    except ImportError:
        raise MissingExtraError("the design of filters needs SciPy: pip install 'strapgen[design]'") from None
    import numpy as np

    matrix, target = np.array(basis).T, np.array(right)
    ones = np.ones((len(target), 1))
    solution = linprog(
        np.append(np.zeros(matrix.shape[1]), 1.0),
        A_ub=np.block([[-matrix, -ones], [matrix, -ones]]),
        b_ub=np.concatenate([-target, target]),
        bounds=(None, None),
        method="highs",
    )
    if solution.x is None:
        raise InputError(f"the linear programme that starts the design has no solution ({solution.message})")
    return [float(value) for value in target - matrix @ solution.x[:-1]]
