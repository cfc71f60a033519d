"""`FixedFilters` has the taps of the filters that commit late as integers, for code in fixed point."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

#: Taps as integers.
Integers = tuple[int, ...]
#: Commits from one normalization of the state to the next.
NORMALIZED_EVERY = 1024


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
    now_error : Fraction
        Bound of the distance of the attitude of now from exact arithmetic, see `library.commit_late_bounds`.
    """

    limit: int
    fraction: int
    sums: range
    sets: tuple[tuple[Integers, ...], ...]
    short: tuple[tuple[Integers, ...], ...]
    shifts: Integers
    restoring: tuple[Integers, Integers]
    restoring_shift: int
    now_error: Fraction = Fraction(0)
