"""The filters with which an attitude is committed late and answered now, as plain tables.

A family of windows has filters for the same samples with any number of them ahead. Where samples are fewer than the
window takes, at the beginning of a recording, polynomials through up to four of them give the rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from strapgen.catalogue.kernels.kernel_names import EXACT_DEGREES, LEGENDRE_DEGREES
from strapgen.catalogue.methods import window_conditions
from strapgen.catalogue.methods.window import Taps, Window
from strapgen.catalogue.methods.windows import EXACT_TERMS
from strapgen.design.commit_late import lost_samples
from strapgen.design.commit_late.lost_samples import REACH, Restoration
from strapgen.ir.exceptions import InputError

#: Most samples that a polynomial goes through.
SHORT = 4
#: Weights of the last four samples in an estimate of the next one, the oldest first: exact for cubic rates.
NEXT: Taps = (Fraction(-1), Fraction(4), Fraction(-6), Fraction(4))

#: A filter for each Legendre coefficient of the rate.
Rows = tuple[Taps, ...]


@dataclass(frozen=True)
class LateFilters:
    """All filters that commit an attitude late, and answer it now.

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
        if len(self.window.one_sided) + 1 != self.window.samples:
            raise InputError(f"{self.window.name} has no one-sided filters; a whole family is needed")

    @property
    def exact(self) -> bool:
        """Whether the rotation of the rate's polynomial is exact."""
        return self.window.rotation == "exact"

    @property
    def samples(self) -> int:
        """Samples of a window: p + 1 + L."""
        return self.window.samples

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
        return min(self.window.degree, max(EXACT_DEGREES if self.exact else LEGENDRE_DEGREES))

    @cached_property
    def sets(self) -> tuple[Rows, ...]:
        """The filters by the number of samples before the interval, from none to p + L."""
        start = () if self.calm_start else self.window.start
        by_previous = {one.previous: one for one in (self.window, *self.window.one_sided, *start)}
        return tuple(self._scaled(by_previous[k].filters[: self.degree + 1]) for k in range(self.samples))

    @cached_property
    def short(self) -> tuple[Rows, ...]:
        """The filters on fewer samples: for each of 1 to 4 samples, those of each interval; see `short_place`."""
        return tuple(
            self._scaled(polynomial(count, place, self.degree))
            for count in range(1, SHORT + 1)
            for place in range(count)
        )

    @property
    def sums(self) -> range:
        """The Legendre coefficients that are sums of samples; of an ideal gyro in rad the first one is a sample."""
        return range(1 if self.window.gyro is None and self.scale == 1 else 0, self.degree + 1)

    def _scaled(self, rows: Rows) -> Rows:
        """Return filters of samples with their scale."""
        return rows if self.scale == 1 else tuple(tuple(tap * self.scale for tap in row) for row in rows)

    @cached_property
    def restoration(self) -> Restoration:
        """The filters that restore a lost sample."""
        return lost_samples.restoration(self.window)


def short_place(count: int, place: int) -> int:
    """Return where the filters of an interval stand in `LateFilters.short`.

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
