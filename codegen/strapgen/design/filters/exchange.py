"""The least largest error over a band, by exchange from a linear programme.

The programme on a grid tells where the largest errors lie; from there the exchange of Remez finds the solution in many
digits. Only these decide, so that a design is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import groupby
from math import isqrt
from operator import mul
from typing import Any, NamedTuple, Protocol

from strapgen.design.filters.band_grid import BITS, REAL, SEARCH_POINTS, integer, mean_points, search_points
from strapgen.design.filters.mean_square import solve
from strapgen.ir.exceptions import InputError, MissingExtraError

#: Change of the level, by itself, at which the exchange ends, and most rounds of it.
_STABLE, _MOST_ROUNDS = Fraction(1, 10**22), 40
#: Largest part of the level by which the largest error may exceed it in the end.
_EXCESS = Fraction(1, 10**9)
#: Steps of Newton's method for an extremum; each doubles the digits, of which the grid gives three.
_NEWTON_STEPS = 6
#: Distance of the frequencies of a difference quotient, in binary digits: its square and the digits that it costs
#: leave more than the exchange needs.
_QUOTIENT_BITS = 80


class Answers(NamedTuple):
    """What unknowns answer at frequencies, and what they have to answer together, in the integers of `band_grid`."""

    #: The answer to a unit of each free unknown
    columns: list[list[int]]
    right: list[int]

    def errors(self, free: Sequence[Any]) -> list[int]:
        """Return what the unknowns leave of the right side at each point."""
        if not free:
            return self.right
        weights = [integer(value) for value in free]
        rows = zip(*self.columns, strict=True)
        return [
            value - (sum(map(mul, weights, row)) >> BITS) for value, row in zip(self.right, rows, strict=True)
        ]


class Problem(Protocol):
    """A function of frequency that is linear in its unknowns, and is to be as small as possible."""

    @property
    def title(self) -> str:
        """What is designed, for an error message."""

    @property
    def free(self) -> int:
        """Number of unknowns that no condition determines."""

    def answers(self, points: Sequence[Any]) -> Answers:
        """Return the answers at frequencies in rad a sample."""


class Solution(NamedTuple):
    """The free unknowns of the least largest error, and that error."""

    free: list[Any]
    level: Any


def least_largest(problem: Problem, band: Fraction, points: int = SEARCH_POINTS) -> Solution:
    """Return the free unknowns of the least largest error over a band.

    `band`: highest angular frequency in rad a sample.
    """
    grid = search_points(band, points)
    table = problem.answers(grid)
    if not problem.free:
        return Solution([], REAL.ldexp(REAL.mpf(max(map(abs, table.right))), -BITS))
    reference = _start(problem, band)
    previous = None
    for _ in range(_MOST_ROUNDS):
        free, level = _levelled(problem.answers(reference))
        errors = table.errors(free)
        places = alternating(errors, problem.free + 1)
        if places is None:
            break
        reference = _refined(problem, grid, places, free)
        if previous is not None and abs(level - previous) * _STABLE.denominator <= level:
            largest = max(map(abs, errors))
            if largest * _EXCESS.denominator > integer(level) * (_EXCESS.denominator + 1):
                break
            return Solution(free, level)
        previous = level
    raise InputError(
        f"{problem.title} over {float(band):g} rad a sample does not converge; "
        "a wider band or fewer samples are needed"
    )


def _levelled(answers: Answers) -> tuple[list[Any], Any]:
    """Return the free unknowns whose errors alternate and are equally large, and how large."""
    matrix = [
        [*(REAL.ldexp(REAL.mpf(column[i]), -BITS) for column in answers.columns), REAL.mpf((-1) ** i)]
        for i in range(len(answers.right))
    ]
    (solution,) = solve(matrix, [[REAL.ldexp(REAL.mpf(value), -BITS) for value in answers.right]])
    return solution[:-1], abs(solution[-1])


def _refined(problem: Problem, grid: Sequence[Any], places: Sequence[int], free: Sequence[Any]) -> list[Any]:
    """Return the frequencies of the extrema of the error next to points of the grid."""
    last = len(grid) - 1
    inner = [place for place in places if 0 < place < last]
    points = {place: grid[place] for place in places}
    distance = REAL.ldexp(1, -_QUOTIENT_BITS)
    for _ in range(_NEWTON_STEPS):
        triples = [points[place] + k * distance for place in inner for k in (-1, 0, 1)]
        errors = problem.answers(triples).errors(free) if triples else []
        for number, place in enumerate(inner):
            before, here, after = errors[3 * number : 3 * number + 3]
            curvature = before - 2 * here + after
            if curvature:
                step = distance * REAL.mpf(after - before) / (2 * curvature)
                points[place] = min(max(points[place] - step, grid[place - 1]), grid[place + 1])
    return [points[place] for place in places]


def alternating(errors: Sequence[Any], count: int) -> list[int] | None:
    """Return the places of so many largest errors of alternating sign; None if the sign alternates too seldom.

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


def _start(problem: Problem, band: Fraction) -> list[Any]:
    """Return frequencies at which a linear programme has its largest errors."""
    points = sorted(mean_points(band))
    errors = _programme(*orthonormal(problem.answers(points)))
    places = alternating(errors, problem.free + 1)
    if places is None:
        raise InputError(
            f"{problem.title} over {float(band):g} rad a sample is beyond the digits of the search; "
            "a wider band or fewer samples are needed"
        )
    return [points[k] for k in places]


def orthonormal(answers: Answers) -> tuple[list[list[float]], list[float]]:
    """Return orthonormal columns and what they leave of the right side, scaled to at most 1, in double precision."""
    basis: list[list[int]] = []
    for column in [*answers.columns, answers.right]:
        for other in basis * 2:
            share = sum(map(mul, column, other)) >> BITS
            column = [a - (share * b >> BITS) for a, b in zip(column, other, strict=True)]
        if len(basis) < len(answers.columns):
            length = isqrt(sum(value * value for value in column))
            if length >> (BITS // 4) == 0:
                raise InputError(
                    "the band is too narrow, or the samples are too many, for a filter to be the best one"
                )
            column = [(value << BITS) // length for value in column]
            basis.append(column)
    largest = max(map(abs, column)) or 1
    scale = isqrt(len(answers.right))
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
