"""`FixedFilters` has the taps of the filters that commit late as integers, for code in fixed point."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

#: Taps as integers.
Integers = tuple[int, ...]
#: Commits from one normalization of the state to the next.
NORMALIZED_EVERY = 1024


class NowErrors(NamedTuple):
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
    #: Bounds of the distance of the attitude of now from exact arithmetic, see `library.commit_late_bounds`
    now_errors: NowErrors = field(default_factory=NowErrors)
