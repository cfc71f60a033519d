"""Symmetric filters of the least largest error over a band."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from operator import mul
from typing import Any, NamedTuple

from strapgen.design.filters import exchange
from strapgen.design.filters.band_grid import BITS, REAL, SEARCH_POINTS, BandGrid, distance, integer
from strapgen.design.filters.exchange import Answers
from strapgen.design.filters.unknowns import Unknowns


class Minimax(NamedTuple):
    """A filter of the least largest error."""

    #: The oldest first
    taps: tuple[Any, ...]
    #: The largest error, for each unit of rate times the sampling interval
    level: Any


def design(unknowns: Unknowns, band: Fraction, points: int = SEARCH_POINTS) -> Minimax:
    """Return the filter of the least largest error over a band under its conditions.

    `band`: highest angular frequency in rad a sample.

    >>> from strapgen.design.filters.unknowns import Shape
    >>> filter = design(Unknowns(Shape(3, 3, 4), 1), Fraction(13, 10))
    >>> [round(float(tap), 12) for tap in filter.taps[4:]], f"{float(filter.level):.6e}"
    ([0.408856141152, -0.099584912922, 0.013437894897], '2.160751e-03')
    """
    solution = exchange.least_largest(FilterProblem(unknowns), band, points)
    values = [REAL.mpf(x.numerator) / x.denominator for x in unknowns.complete([Fraction(0)] * unknowns.free)]
    for value, direction in zip(solution.free, unknowns.directions, strict=True):
        values = [x + value * d.numerator / d.denominator for x, d in zip(values, direction, strict=True)]
    return Minimax(unknowns.taps(values), solution.level)


class FilterProblem:
    """The error of a symmetric or antisymmetric filter, whose answers are real."""

    def __init__(self, unknowns: Unknowns) -> None:
        self._unknowns = unknowns
        self.title = f"the filter of c_{unknowns.m}"
        self.free = unknowns.free
        self._directions = [[integer(x) for x in direction] for direction in unknowns.directions]
        self._base = [integer(x) for x in unknowns.complete([Fraction(0)] * unknowns.free)]

    def answers(self, points: Sequence[Any]) -> Answers:
        """Return the answers at frequencies in rad a sample."""
        unknowns = self._unknowns
        shape = unknowns.shape
        grid = BandGrid(points, shape.twice_middle // 2, increments=shape.increments)
        tables = grid.sines if unknowns.m % 2 else grid.cosines
        single = []
        for group in unknowns.groups:
            number, _ = distance(group[0][0], shape.twice_middle)
            single.append(
                [
                    len(group) * gain * row[number] >> BITS
                    for (gain, _), row in zip(grid.gains, tables, strict=True)
                ]
            )
        rows = list(zip(*single, strict=True)) or [()] * len(points)
        return Answers(
            [[sum(map(mul, direction, row)) >> BITS for row in rows] for direction in self._directions],
            [
                value - (sum(map(mul, self._base, row)) >> BITS)
                for value, row in zip(grid.bessel(unknowns.m), rows, strict=True)
            ],
        )
