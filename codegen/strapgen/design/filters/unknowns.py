"""The unknowns of a filter under its conditions: free outer taps, and inner ones that the conditions determine.

Filters for as many samples before the step as ahead of it, and an ideal gyro, are symmetric or antisymmetric: taps at
the same distance are one unknown, and only powers of the same parity give conditions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from strapgen.catalogue.methods import window_conditions
from strapgen.catalogue.methods.window import GyroResponse, Taps
from strapgen.design.filters.band_grid import distance


@dataclass(frozen=True)
class Shape:
    """What determines the conditions of a filter: the samples around and in a step, the number of powers, the gyro."""

    previous: int
    ahead: int
    conditions: int
    gyro: GyroResponse | None = None
    increments: int = 1

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.previous + self.increments + self.ahead

    @property
    def twice_middle(self) -> int:
        """Twice the place of the middle of the step, which lies between two samples where it has an even number."""
        return 2 * self.previous + self.increments - 1

    @property
    def symmetric(self) -> bool:
        """Whether the filters have a parity."""
        return self.previous == self.ahead and self.gyro is None

    @cached_property
    def rows(self) -> list[Taps]:
        """The increments of the powers of time, (conditions, samples)."""
        samples = self.increments, self.previous, self.ahead
        return window_conditions.increments(samples, self.conditions, self.gyro)


@dataclass(frozen=True)
class Unknowns:
    """The unknowns of one filter, those nearest to the step first.

    >>> unknowns = Unknowns(Shape(3, 3, 4), 1)
    >>> unknowns.groups
    (((4, 1), (2, -1)), ((5, 1), (1, -1)), ((6, 1), (0, -1)))
    >>> [str(tap) for tap in unknowns.taps(unknowns.complete([Fraction(0)]))]
    ['0', '11/240', '-41/120', '0', '41/120', '-11/240', '0']
    """

    shape: Shape
    #: Degree of the Legendre coefficient that the filter estimates
    m: int

    @cached_property
    def groups(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """For each unknown the places of its taps, with a sign."""
        twice = self.shape.twice_middle
        if not self.shape.symmetric:
            places = sorted(range(self.shape.samples), key=lambda place: distance(place, twice))
            return tuple(((place, 1),) for place in places)
        sign = -1 if self.m % 2 else 1
        after, before = twice // 2 + 1, (twice - 1) // 2
        pairs = [((after + k, 1), (before - k, sign)) for k in range(before + 1)]
        return tuple(pairs) if self.m % 2 or twice % 2 else (((twice // 2, 1),), *pairs)

    @cached_property
    def powers(self) -> list[int]:
        """The powers of time that give conditions."""
        every = range(self.shape.conditions)
        return [k for k in every if not self.shape.symmetric or k % 2 == self.m % 2]

    @property
    def inner(self) -> int:
        """Number of unknowns that the conditions determine; they are the first ones."""
        return len(self.powers)

    @property
    def free(self) -> int:
        """Number of the others."""
        return len(self.groups) - self.inner

    @cached_property
    def rows(self) -> list[Taps]:
        """The conditions in the unknowns, (inner, unknowns)."""
        return [
            tuple(
                sum((sign * self.shape.rows[k][place] for place, sign in group), Fraction(0))
                for group in self.groups
            )
            for k in self.powers
        ]

    @cached_property
    def right(self) -> list[Fraction]:
        """The right sides of the conditions."""
        coefficients = window_conditions.coefficients(self.m, self.shape.conditions)
        return [coefficients[k] for k in self.powers]

    def complete(self, outer: Sequence[Fraction]) -> list[Fraction]:
        """Return all unknowns from the free ones, exactly."""
        right = [
            value - sum((a * x for a, x in zip(row[self.inner :], outer, strict=True)), Fraction(0))
            for row, value in zip(self.rows, self.right, strict=True)
        ]
        square = [row[: self.inner] for row in self.rows]
        return [*window_conditions.inner_taps(square, right), *outer]

    @cached_property
    def directions(self) -> list[list[Fraction]]:
        """What a unit of each free unknown adds to all unknowns under the conditions, (free, unknowns)."""
        base = self.complete([Fraction(0)] * self.free)
        units = [[Fraction(int(i == j)) for j in range(self.free)] for i in range(self.free)]
        return [[a - b for a, b in zip(self.complete(unit), base, strict=True)] for unit in units]

    def taps(self, values: Sequence[Any]) -> tuple[Any, ...]:
        """Return the taps of a window, the oldest first, from the values of the unknowns."""
        row = [values[0] * 0 if values else Fraction(0)] * self.shape.samples
        for group, value in zip(self.groups, values, strict=True):
            for place, sign in group:
                row[place] = sign * value
        return tuple(row)

    def values(self, taps: Sequence[Any]) -> list[Any]:
        """Return the unknowns from taps; taps that are one unknown are averaged."""
        return [sum(sign * taps[place] for place, sign in group) / len(group) for group in self.groups]
