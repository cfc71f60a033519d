"""The least largest error over a band, by exchange from a linear programme, and the least sum of absolute errors.

The programme on a grid tells where the largest errors lie; from there the exchange of Remez finds the solution in many
digits. The least weighted sum of absolute errors goes from vertex to vertex, as the simplex method does. At a vertex as
many errors are zero as there are unknowns; its multipliers tell which of them to let go, and the weighted median along
the edge which error becomes zero in its place. Only the many digits decide, so that a design is the same everywhere.

Source: I. Barrodale, F. D. K. Roberts, SIAM J. Numer. Anal. 10 (1973) 839-848, for the sum of absolute errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import groupby
from math import isqrt
from operator import mul
from typing import Any, NamedTuple, Protocol

from strapgen.catalogue.methods.window import Taps
from strapgen.design.filters.band_grid import (
    BITS,
    REAL,
    SEARCH_POINTS,
    BandGrid,
    distance,
    integer,
    mean_points,
    search_points,
)
from strapgen.design.filters.filter_taps import Unknowns
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


class Responses(NamedTuple):
    """Responses of the unknowns at frequencies, and the required sum, in the integers of `band_grid`."""

    #: The answer to a unit of each free unknown
    columns: list[list[int]]
    right: list[int]

    def errors(self, free: Sequence[Any]) -> list[int]:
        """Return the residual of the right side at each point."""
        if not free:
            return self.right
        weights = [integer(value) for value in free]
        rows = zip(*self.columns, strict=True)
        return [
            value - (sum(map(mul, weights, row)) >> BITS) for value, row in zip(self.right, rows, strict=True)
        ]


class Problem(Protocol):
    """A minimization problem: a function of frequency that is linear in its unknowns."""

    @property
    def title(self) -> str:
        """Name of the design, for an error message."""

    @property
    def free(self) -> int:
        """Number of unknowns that no condition determines."""

    def answers(self, points: Sequence[Any]) -> Responses:
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
        free, level = _level(problem.answers(reference))
        errors = table.errors(free)
        places = alternating(errors, problem.free + 1)
        if places is None:
            break
        reference = _refine(problem, grid, places, free)
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


def _level(answers: Responses) -> tuple[list[Any], Any]:
    """Return the free unknowns whose errors alternate and are equally large, and how large."""
    matrix = [
        [*(REAL.ldexp(REAL.mpf(column[i]), -BITS) for column in answers.columns), REAL.mpf((-1) ** i)]
        for i in range(len(answers.right))
    ]
    (solution,) = solve(matrix, [[REAL.ldexp(REAL.mpf(value), -BITS) for value in answers.right]])
    return solution[:-1], abs(solution[-1])


def _refine(problem: Problem, grid: Sequence[Any], places: Sequence[int], free: Sequence[Any]) -> list[Any]:
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


def orthonormal(answers: Responses) -> tuple[list[list[float]], list[float]]:
    """Return orthonormal columns and the residual of the right side, scaled to at most 1, in double precision."""
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


class Minimax(NamedTuple):
    """A filter of the least largest error."""

    #: The oldest first
    taps: tuple[Any, ...]
    #: The largest error, for each unit of rate times the sampling interval
    level: Any


def minimax_filter(
    unknowns: Unknowns, band: Fraction, points: int = SEARCH_POINTS, lever: Taps | None = None
) -> Minimax:
    """Return the filter of the least largest error over a band under its conditions.

    `band`: highest angular frequency in rad a sample. `lever`: v of a pair whose u this is; see `BandGrid.errors`.

    >>> from strapgen.design.filters.filter_taps import Shape
    >>> filter = minimax_filter(Unknowns(Shape(3, 3, 4), 1), Fraction(13, 10))
    >>> [round(float(tap), 12) for tap in filter.taps[4:]], f"{float(filter.level):.6e}"
    ([0.408856141152, -0.099584912922, 0.013437894897], '2.160751e-03')
    """
    solution = least_largest(FilterProblem(unknowns, lever), band, points)
    values = [REAL.mpf(x.numerator) / x.denominator for x in unknowns.complete([Fraction(0)] * unknowns.free)]
    for value, direction in zip(solution.free, unknowns.directions, strict=True):
        values = [x + value * d.numerator / d.denominator for x, d in zip(values, direction, strict=True)]
    return Minimax(unknowns.taps(values), solution.level)


class FilterProblem:
    """The error of a symmetric or antisymmetric filter, whose answers are real."""

    def __init__(self, unknowns: Unknowns, lever: Taps | None = None) -> None:
        self._unknowns = unknowns
        self.title = f"the filter of c_{unknowns.m}"
        self.free = unknowns.free
        self._lever = None if lever is None else list(map(integer, lever))
        self._directions = [[integer(x) for x in direction] for direction in unknowns.directions]
        self._base = [integer(x) for x in unknowns.complete([Fraction(0)] * unknowns.free)]

    def answers(self, points: Sequence[Any]) -> Responses:
        """Return the answers at frequencies in rad a sample."""
        unknowns = self._unknowns
        shape = unknowns.shape
        reach = max(shape.samples, len(self._lever or ())) // 2
        grid = BandGrid(points, reach, increments=shape.increments)
        gains = [gain for gain, _ in grid.gains]
        wanted = [re + im for re, im in shape.wanted(grid, unknowns.m)]  # one of them is 0
        if self._lever is not None:
            levers = grid.response(self._lever)
            gains = [gain * lever >> BITS for gain, (lever, _) in zip(gains, levers, strict=True)]
            wanted = grid.coning()
        tables = grid.sines if unknowns.m % 2 else grid.cosines
        single = []
        for group in unknowns.groups:
            number, _ = distance(group[0][0], shape.twice_middle)
            single.append(
                [len(group) * gain * row[number] >> BITS for gain, row in zip(gains, tables, strict=True)]
            )
        rows = list(zip(*single, strict=True)) or [()] * len(points)
        return Responses(
            [[sum(map(mul, direction, row)) >> BITS for row in rows] for direction in self._directions],
            [
                value - (sum(map(mul, self._base, row)) >> BITS)
                for value, row in zip(wanted, rows, strict=True)
            ],
        )


#: How far a multiplier may exceed 1 at the best vertex.
_MULTIPLIER_EXCESS = REAL.mpf(2) ** -100
#: Most vertices for each point; a few for each unknown are usual.
_MOST_VERTICES = 20


def least_absolute(answers: Responses, weights: Sequence[Any]) -> list[Any]:
    """Return the unknowns of the least sum of w |error|.

    `weights` (n,): above 0.

    >>> one = 1 << BITS
    >>> [float(x) for x in least_absolute(Responses([[one] * 4], [one, 2 * one, 3 * one, 10 * one]), [2, 1, 1, 1])]
    [2.0]
    """
    count, points = len(answers.columns), len(answers.right)
    if points < count:
        raise InputError(f"{points} lines do not determine {count} coefficients")
    if not count:
        return []
    rows = [
        [REAL.ldexp(REAL.mpf(value), -BITS) for value in row] for row in zip(*answers.columns, strict=True)
    ]
    right = [REAL.ldexp(REAL.mpf(value), -BITS) for value in answers.right]
    active = [round(points * (k + 0.5) / count - 0.5) for k in range(count)]
    for _ in range(_MOST_VERTICES * points):
        square = [rows[k] for k in active]
        (free,) = solve(square, [[right[k] for k in active]])
        errors = [
            value - REAL.fdot(zip(row, free, strict=True)) for row, value in zip(rows, right, strict=True)
        ]
        for k in active:
            errors[k] = REAL.mpf(0)
        multipliers = _multipliers(rows, errors, weights, active)
        place = max(range(count), key=lambda k: abs(multipliers[k]))
        if abs(multipliers[place]) <= 1 + _MULTIPLIER_EXCESS:
            return free
        unit = [REAL.mpf(0)] * count
        unit[place] = REAL.mpf(-1 if multipliers[place] > 0 else 1)
        (direction,) = solve(square, [unit])
        slope = weights[active[place]] * (1 - abs(multipliers[place]))
        active[place] = _next(rows, errors, weights, direction, slope, active)
    raise InputError("the coefficients of the least sum of drifts are not reached; fewer samples are needed")


# Least weighted sum of absolute errors, exactly: from vertex to vertex, as the simplex method does.
#
# At a vertex as many errors are zero as there are unknowns. Its multipliers tell which of them to let go, and the
# weighted median along the edge which error becomes zero in its place. All of it is in the integers and digits of
# `band_grid`, so that a design is the same on every machine.
#
# Source: I. Barrodale, F. D. K. Roberts, SIAM J. Numer. Anal. 10 (1973) 839-848.


def _multipliers(
    rows: Sequence[Sequence[Any]], errors: Sequence[Any], weights: Sequence[Any], active: Sequence[int]
) -> list[Any]:
    """Return the slopes of |error| at the active points, by their weights, that would make the vertex the best one."""
    count = len(active)
    pull = [
        -REAL.fsum(w * REAL.sign(e) * row[j] for w, e, row in zip(weights, errors, rows, strict=True))
        for j in range(count)
    ]
    transposed = [[weights[k] * rows[k][j] for k in active] for j in range(count)]
    (multipliers,) = solve(transposed, [pull])
    return multipliers


def _next(
    rows: Sequence[Sequence[Any]],
    errors: Sequence[Any],
    weights: Sequence[Any],
    direction: Sequence[Any],
    slope: Any,
    active: Sequence[int],
) -> int:
    """Return the point whose error becomes zero at the least sum along a direction, which begins with a slope."""
    crossings = []
    for k, (row, error) in enumerate(zip(rows, errors, strict=True)):
        if k in active:
            continue
        change = REAL.fdot(zip(row, direction, strict=True))
        if change and error / change > 0:
            crossings.append((error / change, k, 2 * weights[k] * abs(change)))
    for _, k, more in sorted(crossings):
        slope += more
        if slope >= 0:
            return k
    raise InputError("the lines do not determine the coefficients")
