"""Rounds the taps of filters to binary words, with the least largest error over the band that a search reaches.

Not all conditions hold in binary words: the right sides 3/40 and 1/6 of the cubic and the square one are no binary
fractions. The sum of the taps and, but for a gyro, their first moment hold exactly; the others as nearly as a unit of
a tap lets them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.methods import window_conditions
from strapgen.catalogue.methods.window import Taps, Window
from strapgen.design.filters.band_grid import ONE, integer, search_grid
from strapgen.design.filters.unknowns import Shape, Unknowns
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

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


class _Search:
    """The taps of one filter in words, and their errors in units of the words."""

    def __init__(self, unknowns: Unknowns, window: Window, bits: int, exact: int) -> None:
        self._unknowns = unknowns
        self._window = window
        self._unit = Fraction(1, 1 << bits)
        self._exact = sum(power < exact for power in unknowns.powers)
        self._grid = search_grid(window.band, window.samples - 1, window.gyro, _POINTS, window.increments)

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
        errors = self._grid.errors(self._unknowns.m, taps, self._window.previous)
        return np.array([complex(re / ONE, im / ONE) for re, im in errors])


def _sum(first: Sequence[int], second: Sequence[int]) -> list[int]:
    return [a + b for a, b in zip(first, second, strict=True)]
