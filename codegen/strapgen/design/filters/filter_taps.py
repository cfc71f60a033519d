"""The taps of a filter under its conditions: free outer ones, inner ones that these determine, and their rounding.

Filters for as many samples before the step as ahead of it, and an ideal gyro, are symmetric or antisymmetric: taps at
the same distance are one unknown, and only powers of the same parity give conditions.

Taps are rounded to rationals inside their conditions. In binary words not all conditions hold: the right sides 3/40 and
1/6 of the cubic and the square one are no binary fractions. There the sum of the taps and, but for a gyro, their first
moment hold exactly, the others as nearly as a unit of a tap lets them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.methods import window_conditions
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.window import Taps, Window
from strapgen.design.filters.band_grid import ONE, REAL, BandGrid, distance, integer, search_grid
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError


@dataclass(frozen=True)
class Shape:
    """Parameters of the conditions of filters: samples around and in a step, number of powers, gyro.

    Of a pair the filter of degree 2 gives c_2 - 5 c_0 in place of c_2, which is 30 times what v gives.
    """

    previous: int
    ahead: int
    conditions: int
    gyro: Response | None = None
    increments: int = 1
    pair: bool = False

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

    def right(self, m: int) -> Taps:
        """Return the right sides of the conditions of a filter, (conditions,)."""
        own, mean = (window_conditions.coefficients(degree, self.conditions) for degree in (m, 0))
        return tuple(a - 5 * b for a, b in zip(own, mean, strict=True)) if self._is_lever(m) else own

    def wanted(self, grid: BandGrid, m: int) -> list[tuple[int, int]]:
        """Return the response that a filter is to have, as real and imaginary part, by frequency."""
        own, mean = grid.wanted(m), grid.wanted(0)
        return (
            [(x - 5 * y, 0) for (x, _), (y, _) in zip(own, mean, strict=True)] if self._is_lever(m) else own
        )

    def _is_lever(self, m: int) -> bool:
        return self.pair and m == 2


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
        right = self.shape.right(self.m)
        return [right[k] for k in self.powers]

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
        """The derivatives of all unknowns by the free ones under the conditions, (free, unknowns)."""
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


#: Free taps of a table are multiples of 2 to the power of minus this.
TABLE_BITS = 60


def rounded(unknowns: Unknowns, taps: Sequence[Any], bits: int = TABLE_BITS) -> Taps:
    """Return taps as rationals: the outer ones as nearest multiples of a unit, the inner ones from the conditions.

    `taps` (p + 1 + L): the oldest first.

    >>> from strapgen.design.filters.filter_taps import Shape
    >>> taps = [0, 0, 0, 0, 0.408856141152301, -0.0995849129218411, 0.0134378948971269]
    >>> taps[:3] = [-tap for tap in reversed(taps[4:])]
    >>> [str(tap) for tap in rounded(Unknowns(Shape(3, 3, 4), 1), taps, 30)[4:]]
    ['3292544549/8053063680', '-200490913/2013265920', '7214415/536870912']
    """
    outer = [nearest(value, bits) for value in unknowns.values(taps)[unknowns.inner :]]
    return unknowns.taps(unknowns.complete(outer))


def nearest(value: Any, bits: int) -> Fraction:
    """Return the multiple of 2^-bits nearest to a number.

    >>> nearest(REAL.mpf(1) / 3, 4)
    Fraction(5, 16)
    """
    return Fraction(int(REAL.nint(REAL.ldexp(value, bits))), 1 << bits)


#: Frequencies of the search, and most free taps of which all combinations are tried; of more, one is moved at a time.
_POINTS, _MOST_COMBINED = 300, 7


def in_words(window: Window, bits: int) -> Window:
    """Return a window whose taps are multiples of 2^-bits, with the errors of a search over a unit of each free tap.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> words = in_words(WINDOWS["window-3-3"], 30)
    >>> words.conditions, words.parity, [str(tap * 2**30) for tap in words.filters[1][4:]]
    (2, True, ['439005945', '-106928491', '14428831'])
    """
    digits = checks.count("bits", bits, smallest=2, largest=128)
    exact = min(window.conditions, 1 if window.gyro else 2)
    shape = Shape(window.previous, window.ahead, window.conditions, window.gyro, window.increments)
    if shape.symmetric and not window.parity:
        raise InputError(f"{window.name} has no symmetry; its taps are not rounded to words")
    rows = [
        _Search(Unknowns(shape, m), window, digits, exact).best(row) for m, row in enumerate(window.filters)
    ]
    return replace(window, filters=tuple(rows), conditions=exact, one_sided=(), start=())


# Rounds the taps of filters to binary words, with the least largest error over the band that a search reaches.
#
# Not all conditions hold in binary words: the right sides 3/40 and 1/6 of the cubic and the square one are no binary
# fractions. The sum of the taps and, but for a gyro, their first moment hold exactly; the others as nearly as a unit of
# a tap lets them.


class _Search:
    """The taps of one filter in words, and their errors in units of the words."""

    def __init__(self, unknowns: Unknowns, window: Window, bits: int, exact: int) -> None:
        self._unknowns = unknowns
        self._window = window
        self._unit = Fraction(1, 1 << bits)
        self._exact = sum(power < exact for power in unknowns.powers)
        self._grid = search_grid(
            window.band, window.total_increments - 1, window.gyro, _POINTS, window.increments
        )
        lever = window.partner(unknowns.m)
        self._lever = None if lever is None else list(map(integer, lever))

    def best(self, taps: Taps) -> Taps:
        """Return the taps of the least largest error."""
        if self._in_words(taps):
            return taps
        free = self._unknowns.free
        start = [round(value / self._unit) for value in self._unknowns.values(taps)[self._unknowns.inner :]]
        self._base = self._values(start)
        self._error = self._errors(self._base)
        self._changes = np.array(
            [self._errors(self._base, place) - self._error for place in range(len(self._base))]
        )
        if free <= _MOST_COMBINED:
            return self._taps(self._least([_sum(start, move) for move in product((0, -1, 1), repeat=free)]))
        chosen = start
        while True:
            steps = [[int(i == k) * sign for i in range(free)] for k in range(free) for sign in (-1, 1)]
            near = [_sum(chosen, step) for step in steps]
            near = [each for each in near if all(abs(a - b) <= 1 for a, b in zip(each, start, strict=True))]
            best = self._least([chosen, *near])
            if best == chosen:
                return self._taps(chosen)
            chosen = best

    def _in_words(self, taps: Taps) -> bool:
        return all((tap / self._unit).denominator == 1 for tap in taps)

    def _values(self, outer: list[int]) -> list[Fraction]:
        """Return all unknowns in words: the inner ones nearest to the conditions, the first ones on the exact ones."""
        unknowns, exact = self._unknowns, self._exact
        values = unknowns.complete([value * self._unit for value in outer])
        values = [round(value / self._unit) * self._unit for value in values]
        right = [
            value - sum((a * x for a, x in zip(row[exact:], values[exact:], strict=True)), Fraction(0))
            for row, value in zip(unknowns.rows[:exact], unknowns.right[:exact], strict=True)
        ]
        square = [row[:exact] for row in unknowns.rows[:exact]]
        return [*window_conditions.inner_taps(square, right), *values[exact:]]

    def _taps(self, outer: list[int]) -> Taps:
        return self._unknowns.taps(self._values(outer))

    def _least(self, candidates: list[list[int]]) -> list[int]:
        """Return the candidate of the least largest error, the first of equal ones."""
        counts = [
            [int((b - a) / self._unit) for a, b in zip(self._base, self._values(outer), strict=True)]
            for outer in candidates
        ]
        errors = self._error + np.array(counts) @ self._changes
        return candidates[int(np.abs(errors).max(axis=1).argmin())]

    def _errors(self, values: list[Fraction], moved: int | None = None) -> NDArray[Any]:
        """Return the errors on the grid, with one of the unknowns a unit higher."""
        values = [value + self._unit * (place == moved) for place, value in enumerate(values)]
        taps = [integer(tap) for tap in self._unknowns.taps(values)]
        errors = self._grid.errors(self._unknowns.m, taps, self._window.previous, self._lever)
        return np.array([complex(re / ONE, im / ONE) for re, im in errors])


def _sum(first: Sequence[int], second: Sequence[int]) -> list[int]:
    return [a + b for a, b in zip(first, second, strict=True)]
