"""The filters of a unit that commits an attitude late, as plain tables.

A family of windows has filters for the same samples with any number of them ahead. Where samples are fewer than the
window takes, at the beginning of a recording, polynomials through up to four of them give the rate.

Other filters restore a lost sample from those on both sides of it, with or without the sum of it and the next one. The
rate has no frequency above the band of a window, so that a lost increment follows from its neighbours. The filter f
makes the mean over the band of |A_0(b)|^2 |sum_j f_j e^(ijb) - 1|^2 least, A_0 what a sample shows of the rate e^(ibt),
with a small weight of the squares of the taps. Their sum is 1, so that a constant rate is restored exactly. In the
digits of `band_grid` the taps come out alike on every machine; they are rounded to multiples of 2^-60.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache
from operator import mul
from typing import Any, NamedTuple

from strapgen.catalogue.kernels.kernel_names import EXACT_DEGREES, LEGENDRE_DEGREES
from strapgen.catalogue.methods import window_conditions
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.window import Taps, Window
from strapgen.catalogue.methods.windows import EXACT_TERMS
from strapgen.design.filters.band_grid import BITS, REAL, mean_grid, real
from strapgen.design.filters.filter_taps import TABLE_BITS, nearest
from strapgen.design.filters.mean_square import solve
from strapgen.ir.exceptions import InputError

#: Most samples that a polynomial goes through.
SHORT = 4
#: Weights of the last four samples in an estimate of the next one, the oldest first: exact for cubic rates.
NEXT: Taps = (Fraction(-1), Fraction(4), Fraction(-6), Fraction(4))

#: A filter for each Legendre coefficient of the rate.
Rows = tuple[Taps, ...]


@dataclass(frozen=True)
class LateFilters:
    """All filters of a unit that commits an attitude late.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> filters = LateFilters(WINDOWS["window-3-3"])
    >>> filters.samples, filters.capacity, filters.most_commits, len(filters.sets), len(filters.short)
    (7, 17, 9, 7, 10)
    """

    #: A family with steps of one sample
    window: Window
    #: Whether the first intervals of a recording have filters of small noise gain too, which words can hold, in
    #: place of the family's own for its start
    calm_start: bool = False
    #: What the samples are multiplied by to be increments in rad: that of the counts of a gyro
    scale: Fraction = Fraction(1)

    def __post_init__(self) -> None:
        """Refuse windows for which there are no such filters."""
        if self.window.increments != 1:
            raise InputError(
                f"{self.window.name} has steps of {self.window.increments} samples; only steps of one sample can be "
                "committed late"
            )
        if self.exact and self.window.terms != EXACT_TERMS:
            raise InputError(
                f"the rotation of {self.window.name} has {self.window.terms} terms; one of {EXACT_TERMS} can be "
                "committed late"
            )
        if len(self.window.one_sided) + 1 != self.window.total_increments:
            raise InputError(f"{self.window.name} has no one-sided filters; a whole family is needed")

    @property
    def exact(self) -> bool:
        """Whether the rotation of the rate's polynomial is exact."""
        return self.window.rotation == "exact"

    @property
    def samples(self) -> int:
        """Samples of a window: p + 1 + L."""
        return self.window.total_increments

    @property
    def capacity(self) -> int:
        """Samples that are held: a window and those after a gap, and at least what restores a lost sample."""
        return max(self.samples + REACH, 2 * REACH + 1)

    @property
    def most_commits(self) -> int:
        """Most intervals that one sample commits: after a gap, or after one in the last sample of the start."""
        waited = self.window.previous + self.window.ahead >= REACH
        start = self.window.previous + 1
        return start + REACH if waited else max(start, 1 + REACH)

    @property
    def degree(self) -> int:
        """Highest Legendre coefficient that a step takes."""
        degree = max(one.degree for one in (self.window, *self.window.one_sided))
        return min(degree, max(EXACT_DEGREES if self.exact else LEGENDRE_DEGREES))

    @cached_property
    def sets(self) -> tuple[Rows, ...]:
        """The filters by the number of samples before the interval, from none to p + L."""
        start = () if self.calm_start else self.window.start
        by_previous = {one.previous: one for one in (self.window, *self.window.one_sided, *start)}
        none: Rows = (
            (Fraction(0),) * self.samples,
        ) * self.degree  # a pair has fewer than what goes beside it
        return tuple(
            self._scale((*by_previous[k].filters, *none)[: self.degree + 1]) for k in range(self.samples)
        )

    @cached_property
    def short(self) -> tuple[Rows, ...]:
        """The filters on fewer samples: for each of 1 to 4 samples, those of each interval; see `short_place`."""
        return tuple(
            self._scale(polynomial(count, place, self.degree))
            for count in range(1, SHORT + 1)
            for place in range(count)
        )

    @property
    def sums(self) -> range:
        """The Legendre coefficients that are sums of samples; of an ideal gyro in rad the first one is a sample."""
        return range(1 if self.window.gyro is None and self.scale == 1 else 0, self.degree + 1)

    def _scale(self, rows: Rows) -> Rows:
        """Return filters of samples with their scale."""
        return rows if self.scale == 1 else tuple(tuple(tap * self.scale for tap in row) for row in rows)

    @cached_property
    def restoration(self) -> Restoration:
        """The filters that restore a lost sample."""
        return restoration(self.window)


def short_place(count: int, place: int) -> int:
    """Return the index of the filters of an interval in `LateFilters.short`.

    >>> [short_place(3, place) for place in range(3)]
    [3, 4, 5]
    """
    return count * (count - 1) // 2 + place


def polynomial(count: int, place: int, degree: int) -> Rows:
    """Return the Legendre coefficients over one interval of the polynomial rate that has some increments.

    >>> [[str(tap) for tap in row] for row in polynomial(2, 1, 2)]
    [['0', '1'], ['-1/2', '1/2'], ['0', '0']]
    """
    rows = window_conditions.increments((1, place, count - 1 - place), count)
    return tuple(
        tuple(window_conditions.inner_taps(rows, window_conditions.coefficients(m, count)))
        for m in range(degree + 1)
    )


#: Samples on each side of a lost one that restore it.
REACH = 8
#: Weight of the squares of the taps.
WEIGHT = Fraction(1, 10**16)


class Restoration(NamedTuple):
    """The filters that restore a lost sample, the oldest tap first: those of samples -8 to 8, 0 the lost one."""

    #: The tap of the lost sample is 0
    lost: Taps
    #: Where the sum of the lost sample and the next one is known: both have the tap of the sum
    merged: Taps


def restoration(window: Window) -> Restoration:
    """Return the filters that restore a lost sample within the band of a window.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> filters = restoration(WINDOWS["window-3-3"])
    >>> sum(filters.lost), sum(filters.merged), [round(float(tap), 4) for tap in filters.lost[8:]]
    (Fraction(1, 1), Fraction(1, 1), [0.0, 0.9129, -0.6925, 0.4323, -0.218, 0.086, -0.0251, 0.0049, -0.0005])
    """
    return _restoration(window.band, window.gyro)


@lru_cache(maxsize=8)
def _restoration(band: Fraction, gyro: Response | None) -> Restoration:
    grid = mean_grid(band, 2 * REACH, gyro)
    squares = grid.squares()
    lags = [real(sum(map(mul, squares, column)) >> BITS) for column in zip(*grid.lags, strict=True)]
    outer = [(j,) for j in range(-REACH, REACH + 1) if j not in (0, 1)]
    return Restoration(_taps(lags, [(-j, j) for j in range(1, REACH + 1)]), _taps(lags, [*outer, (0, 1)]))


def _taps(lags: Sequence[Any], groups: Sequence[tuple[int, ...]]) -> Taps:
    """Return the taps of samples -8 to 8, alike in each group of samples, that leave the least sum of squares.

    The functions of two samples i and j have the product `lags[|i - j|]`; the sum of all taps is 1.
    """

    def product(group: Sequence[int], other: Sequence[int]) -> Any:
        return sum((lags[abs(i - j)] for i in group for j in other), REAL.mpf(0))

    lengths = [REAL.mpf(len(group)) for group in groups]
    matrix = [
        [*(product(group, other) for other in groups), length]
        for group, length in zip(groups, lengths, strict=True)
    ]
    for row, length in enumerate(lengths):
        matrix[row][row] += length * WEIGHT.numerator / WEIGHT.denominator
    right = [*(product(group, (0,)) for group in groups), REAL.mpf(1)]
    (solution,) = solve([*matrix, [*lengths, REAL.mpf(0)]], [right])
    taps = [nearest(value, TABLE_BITS) for value in solution[:-1]]
    # The largest tap takes up the rounding of the sum, a few units.
    largest = max(range(len(taps)), key=lambda row: abs(taps[row]))
    rest = sum((len(group) * tap for group, tap in zip(groups, taps, strict=True)), Fraction(0))
    taps[largest] += (1 - rest) / len(groups[largest])
    by_sample = {j: tap for group, tap in zip(groups, taps, strict=True) for j in group}
    return tuple(by_sample.get(j, Fraction(0)) for j in range(-REACH, REACH + 1))


#: Taps as integers.
Integers = tuple[int, ...]
#: Commits from one normalization of the state to the next.
NORMALIZED_EVERY = 1024


class PresentErrors(NamedTuple):
    """Bounds of the distance of the attitude of now from the exact filters and steps on the same integers.

    They are lengths of the difference of the state, of a row for a matrix. The integers are those of the committed
    attitude and of the samples that are held.
    """

    #: With L intervals waiting
    running: Fraction = Fraction(0)
    #: With up to p + L, before as many samples are there as filters take
    start: Fraction = Fraction(0)
    #: While a lost sample waits to be restored
    gap: Fraction = Fraction(0)


@dataclass(frozen=True)
class FixedFilters:
    """The taps of all filters as integers."""

    #: Largest magnitude of a sample
    limit: int
    #: Fraction bits of a sample
    fraction: int
    #: Legendre coefficients that are sums of samples; of an ideal gyro the first one is a sample itself
    sums: range
    #: The filters as in `LateFilters`, rows of `sums`
    sets: tuple[tuple[Integers, ...], ...]
    short: tuple[tuple[Integers, ...], ...]
    #: Bits by which the sum of each row is shifted down
    shifts: Integers
    #: The filters of a lost sample, and of one whose sum with the next is known
    restoring: tuple[Integers, Integers]
    #: Bits by which their sums are shifted down
    restoring_shift: int
    #: Bounds of the distance of the attitude of now from exact arithmetic, see `commit_late_fixed.now_errors`
    now_errors: PresentErrors = field(default_factory=PresentErrors)
