"""Designs the filters of `strapgen.stamped.boundary_filters.toml` again: the least largest error over the band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from operator import mul
from typing import Any

from strapgen.catalogue.methods import window_conditions
from strapgen.design.filters.band_grid import BITS, BandGrid, integer
from strapgen.design.filters.exchange import Responses, least_largest
from strapgen.design.filters.filter_taps import TABLE_BITS, nearest


@dataclass(frozen=True)
class BoundaryProblem:
    """The rate, or its slope, at a boundary of samples from pairs of them around it.

    The rate is exact on 1 and t^2, the slope on t and t^3: the nearest two weights follow from the others.
    """

    pairs: int
    is_slope: bool

    @property
    def title(self) -> str:
        return f"the {'slope' if self.is_slope else 'rate'} of {self.pairs} pairs"

    @property
    def free(self) -> int:
        return self.pairs - 2

    def complete(self, outer: Sequence[Fraction]) -> list[Fraction]:
        """Return all weights from the free outer ones, exactly."""
        # The samples of t^k in the pair r together: 2 (r^(k+1) - (r-1)^(k+1))/(k+1).
        powers = (1, 3) if self.is_slope else (0, 2)
        rows = [
            [Fraction(2 * (r ** (k + 1) - (r - 1) ** (k + 1)), k + 1) for r in range(1, self.pairs + 1)]
            for k in powers
        ]
        right = [
            value - sum(map(mul, row[2:], outer))
            for value, row in zip((Fraction(1), Fraction(0)), rows, strict=True)
        ]
        return [*window_conditions.inner_taps([row[:2] for row in rows], right), *outer]

    @cached_property
    def _base(self) -> list[Fraction]:
        return self.complete([Fraction(0)] * self.free)

    @cached_property
    def _directions(self) -> list[list[Fraction]]:
        units = [[Fraction(int(i == j)) for j in range(self.free)] for i in range(self.free)]
        return [[a - b for a, b in zip(self.complete(unit), self._base, strict=True)] for unit in units]

    def answers(self, points: Sequence[Any]) -> Responses:
        """Return the answers at frequencies b: 2 cos((r - 1/2) b) sin(b/2)/(b/2) of a pair, for the slope the sine."""
        grid = BandGrid(points, self.pairs, increments=2)
        tables = grid.sines if self.is_slope else grid.cosines
        # Of a step of two samples the gain is that of one sample, and the tables begin at 1/2.
        single = [
            [2 * gain * row[r] >> BITS for r in range(self.pairs)]
            for (gain, _), row in zip(grid.gains, tables, strict=True)
        ]
        right = [integer(b) if self.is_slope else 1 << BITS for b in points]

        def sums(weights: Sequence[Fraction]) -> list[int]:
            numbers = [integer(weight) for weight in weights]
            return [sum(map(mul, numbers, row)) >> BITS for row in single]

        return Responses(
            [sums(direction) for direction in self._directions],
            [value - base for value, base in zip(right, sums(self._base), strict=True)],
        )


def designed(pairs: int, is_slope: bool, band: Fraction) -> tuple[tuple[Fraction, ...], float]:
    """Return the weights of the pairs, the nearest first, and the largest error over the band."""
    problem = BoundaryProblem(pairs, is_slope)
    solution = least_largest(problem, band)
    return tuple(problem.complete([nearest(value, TABLE_BITS) for value in solution.free])), float(
        solution.level
    )
