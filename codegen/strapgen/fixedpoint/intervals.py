"""`Interval` is exact interval arithmetic: ends are dyadic rationals, rounded outward to enclose every result."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

#: Ends are whole multiples of 2**-GRID, which makes them integers: far below any place that a word reaches.
GRID = 160
_ONE = 1 << GRID


@dataclass(slots=True, unsafe_hash=True)
class Interval:
    """All numbers from `low` to `high`, both counted in units of 2**-GRID.

    >>> x = Interval.of(Fraction(-1, 2), 3)
    >>> (x * x).text(), x.square().text()
    ('[-1.5, 9]', '[0, 9]')
    """

    low: int
    high: int

    @classmethod
    def of(cls, low: Fraction | int, high: Fraction | int | None = None) -> Interval:
        """Return the smallest interval on the grid that holds everything from `low` to `high`."""
        first, last = Fraction(low), Fraction(low if high is None else high)
        return cls(
            (first.numerator << GRID) // first.denominator, -((-last.numerator << GRID) // last.denominator)
        )

    @classmethod
    def symmetric(cls, bound: Fraction | int) -> Interval:
        """Return the interval of all numbers of at most this magnitude."""
        return cls.of(-Fraction(bound), bound)

    @property
    def lowest(self) -> Fraction:
        """The lower end."""
        return Fraction(self.low, _ONE)

    @property
    def highest(self) -> Fraction:
        """The upper end."""
        return Fraction(self.high, _ONE)

    @property
    def magnitude(self) -> Fraction:
        """The largest magnitude of a number inside."""
        return Fraction(max(abs(self.low), abs(self.high)), _ONE)

    def text(self) -> str:
        """Return the ends as decimals, for a reader."""
        return f"[{float(self.lowest):.6g}, {float(self.highest):.6g}]"

    def __contains__(self, value: Fraction | int) -> bool:
        return self.lowest <= value <= self.highest

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Interval) -> Interval:
        return Interval(self.low - other.high, self.high - other.low)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __mul__(self, other: Interval) -> Interval:
        corners = (
            self.low * other.low,
            self.low * other.high,
            self.high * other.low,
            self.high * other.high,
        )
        return Interval(min(corners) >> GRID, -(-max(corners) >> GRID))

    def scale(self, factor: Fraction) -> Interval:
        """Return the interval times an exact number."""
        ends = (self.low * factor.numerator, self.high * factor.numerator)
        return Interval(min(ends) // factor.denominator, -(-max(ends) // factor.denominator))

    def widened(self, by: Fraction) -> Interval:
        """Return the interval with `by` more on either side."""
        return self + Interval.symmetric(by)

    def square(self) -> Interval:
        """Return the squares: none is below zero."""
        lowest = 0 if self.low <= 0 <= self.high else min(abs(self.low), abs(self.high))
        largest = max(abs(self.low), abs(self.high))
        return Interval(lowest * lowest >> GRID, -(-largest * largest >> GRID))

    def sqrt(self) -> Interval:
        """Return the square roots; ValueError for negative numbers."""
        if self.low < 0:
            raise ValueError(f"a square root of {self.text()}")
        high = math.isqrt(self.high << GRID)
        return Interval(math.isqrt(self.low << GRID), high + (high * high < self.high << GRID))

    def reciprocal(self) -> Interval:
        """Return the reciprocals; ValueError if zero lies inside."""
        if self.low <= 0 <= self.high:
            raise ValueError(f"a division by {self.text()}")
        return Interval(_ONE * _ONE // self.high, -(-_ONE * _ONE // self.low))

    def join(self, other: Interval) -> Interval:
        """Return the smallest interval that holds both."""
        return Interval(min(self.low, other.low), max(self.high, other.high))

    def meet(self, other: Interval) -> Interval:
        """Return the intersection."""
        return Interval(max(self.low, other.low), min(self.high, other.high))

    def halves(self) -> tuple[Interval, Interval]:
        """Return the lower and the upper half."""
        middle = (self.low + self.high) >> 1
        return Interval(self.low, middle), Interval(middle, self.high)


def root(value: Fraction) -> Fraction:
    """Return an upper bound of a square root."""
    return Interval.of(value).sqrt().highest


def norm(values: Iterable[Fraction]) -> Fraction:
    """Return an upper bound of the length of a vector."""
    return root(sum((value * value for value in values), Fraction(0)))


def maximum(intervals: Iterable[Interval]) -> Interval:
    """Return the interval of the largest of several numbers."""
    ranges = list(intervals)
    return Interval(max(r.low for r in ranges), max(r.high for r in ranges))
