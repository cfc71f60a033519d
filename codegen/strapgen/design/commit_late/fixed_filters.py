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

    Parameters
    ----------
    running : Fraction
        With L intervals waiting.
    start : Fraction
        With up to p + L, before as many samples are there as filters take.
    gap : Fraction
        While a lost sample waits to be restored.
    """

    running: Fraction = Fraction(0)
    start: Fraction = Fraction(0)
    gap: Fraction = Fraction(0)


@dataclass(frozen=True)
class FixedFilters:
    """The taps of all filters as integers.

    Parameters
    ----------
    limit : int
        Largest magnitude of a sample.
    fraction : int
        Fraction bits of a sample.
    sums : range
        Legendre coefficients that are sums of samples; of an ideal gyro the first one is a sample itself.
    sets, short : tuple of tuple of tuple of int
        The filters as in `LateFilters`, rows of `sums`.
    shifts : tuple of int
        Bits by which the sum of each row is shifted down.
    restoring : tuple of tuple of int, (2, 17)
        The filters of a lost sample, and of one whose sum with the next is known.
    restoring_shift : int
        Bits by which their sums are shifted down.
    now_errors : NowErrors
        Bounds of the distance of the attitude of now from exact arithmetic, see `library.commit_late_bounds`.
    """

    limit: int
    fraction: int
    sums: range
    sets: tuple[tuple[Integers, ...], ...]
    short: tuple[tuple[Integers, ...], ...]
    shifts: Integers
    restoring: tuple[Integers, Integers]
    restoring_shift: int
    now_errors: NowErrors = field(default_factory=NowErrors)
