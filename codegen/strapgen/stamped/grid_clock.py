"""Follows the clock of a sensor, whose stamps jitter, by an even grid; whole numbers, the same in every language.

The grid begins as the line of least squares through the first stamps. From then on it is corrected once a block: the
mean distance of its stamps turns the grid back over the next block, and a part of it goes into the interval and into
its change. So the grid is even but for changes of some 1e-5 of an interval from block to block where stamps jitter by
1e-2, and follows a clock that drifts. Times are whole multiples of 2^-shift ticks, about 2^-40 of an interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from fractions import Fraction

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.stamped.boundary_kernels import FARTHEST

Number = float | str | Fraction

#: Stamps that the grid begins with, a block too.
BLOCK = 32
#: Binary digits of an interval, and those of an offset behind the point.
DIGITS, OFFSET_BITS = 40, 30
#: By how many bits the mean distance of a block is shifted down: for each interval of the next block, for the interval
#: and for its change an interval. Of a block these are 1/2, 1/8 and 1/64.
HOLD, PERIOD, TURN = 6, 8, 16
#: The clock may be off by 2^-5 of its nominal rate: a little over 3 %.
RATE = 5
#: Fewest ticks of an interval, and most.
FEWEST, MOST = 20, 1 << 31


class StampStatus(IntEnum):
    """What a call returns that refuses a sample.

    Examples
    --------
    >>> StampStatus(-2).name
    'OFFSET'
    """

    #: The sample lies outside its range, in fixed point
    RANGE = -1
    #: The instant is farther than 5 % of an interval from its boundary
    OFFSET = -2
    #: The stamp is that of the sample before, or more than two intervals after it
    GAP = -3
    #: A pointer is null, in C
    NULL = -4
    #: The sensor's rate is more than 3 % off the nominal one
    RATE = -5


class StampError(InputError):
    """A stamp that the grid cannot take; the state is that before the call.

    Attributes
    ----------
    status : StampStatus
        What is wrong with it.
    reason : str
        That in words.
    place : int or None
        Which stamp or sample of a whole recording it is, from 0 on.

    Examples
    --------
    >>> raise StampError(StampStatus.GAP, "a sample is lost")
    Traceback (most recent call last):
        ...
    strapgen.stamped.grid_clock.StampError: a sample is lost
    """

    def __init__(self, status: StampStatus, reason: str, place: int | None = None) -> None:
        super().__init__(reason if place is None else f"stamp {place + 1}: {reason}")
        self.status: StampStatus = status
        self.reason: str = reason
        self.place: int | None = place


@dataclass(frozen=True)
class StampScale:
    """The nominal interval and the counter of the stamps.

    >>> StampScale.of(200, 1e6)
    StampScale(bits=64, shift=27, nominal=671088640000, most=10000)
    """

    #: Bits of a stamp
    bits: int
    #: Binary digits of times behind the point of a tick
    shift: int
    #: The nominal interval
    nominal: int
    #: Most ticks from one stamp to the next
    most: int

    @classmethod
    def of(cls, sample_hz: Number, tick_hz: Number, bits: int = 64) -> StampScale:
        """Return the scale for the nominal rate in Hz and that of the ticks."""
        rate = checks.number("sample_hz", sample_hz, positive=True)
        ticks = checks.number("tick_hz", tick_hz, positive=True) / rate
        bits = checks.count("stamp_bits", bits, smallest=8, largest=64)
        if not FEWEST <= ticks <= MOST:
            raise InputError(
                f"a sampling interval is {float(ticks):g} ticks; from {FEWEST} to {MOST:,} are needed (tick_hz)"
            )
        if ticks * 4 > 1 << bits:
            raise InputError(
                f"a stamp of {bits} bits wraps within four sampling intervals of {float(ticks):g} ticks; more bits, or "
                "slower ticks, are needed"
            )
        shift = DIGITS - int(ticks).bit_length()
        return cls(bits, shift, round(ticks * (1 << shift)), int(2 * ticks))


@dataclass(slots=True)
class GridClock:
    """The grid so far.

    >>> clock = GridClock(StampScale.of(200, 1e6))
    >>> offsets = [clock.take(5000 * k + 25 * (k % 2)) for k in range(40)]
    >>> len(offsets[31]), [round(offset / 2**30, 4) for offset in offsets[39]], round(clock.period / 2**27, 1)
    (32, [0.0022], 5000.1)
    """

    scale: StampScale
    last: int = 0
    #: Times of the first stamps, from the first one on, until the grid begins
    first: list[int] = field(default_factory=list)
    #: The last instant less its boundary
    ahead: int = 0
    #: Interval of the grid, 0 before it begins, and its change from interval to interval
    period: int = 0
    turn: int = 0
    #: What is added to the interval in this block
    hold: int = 0
    #: Sum of the distances of the block so far, and their number
    total: int = 0
    number: int = 0

    def take(self, stamp: int) -> list[int]:
        """Take a stamp, and return the offsets of the boundaries that it makes known, in 2^-30 intervals."""
        if not self.first and not self.period:
            self.last, self.first = stamp, [0]
            return []
        ticks = (stamp - self.last) & ((1 << self.scale.bits) - 1)
        if not 0 < ticks <= self.scale.most:
            raise StampError(
                StampStatus.GAP,
                f"the stamp {stamp} is {ticks} ticks after the one before; up to {self.scale.most}, two sampling "
                "intervals, are allowed",
            )
        step = ticks << self.scale.shift
        if not self.period:
            times = [*self.first, self.first[-1] + step]
            offsets = self._begin(times) if len(times) == BLOCK else []
            self.last, self.first = stamp, times
            return offsets
        period = self.period + self.turn
        interval = period + self.hold
        ahead = self.ahead + step - interval
        self._require(period, interval, [ahead])
        self.last, self.period, self.ahead = stamp, period, ahead
        self.total, self.number = self.total + ahead, self.number + 1
        if self.number == BLOCK:
            mean = self.total // BLOCK
            self.total = self.number = 0
            self.hold = mean >> HOLD
            self.period += mean >> PERIOD
            self.turn += mean >> TURN
        return [_offset(ahead, interval)]

    def finish(self) -> list[int]:
        """Begin the grid, if it has not begun, with the stamps that are there."""
        return self._begin(self.first) if not self.period and len(self.first) > 1 else []

    def _begin(self, times: Sequence[int]) -> list[int]:
        """Begin the grid as the line of least squares through times, and return the offsets of all of them."""
        count = len(times)
        total = sum(times)
        moment = sum(k * time for k, time in enumerate(times))
        period = (12 * moment - 6 * (count - 1) * total) // (count * (count * count - 1))
        start = (total - period * (count * (count - 1) // 2)) // count
        distances = [time - start - k * period for k, time in enumerate(times)]
        self._require(period, period, distances)
        self.period, self.ahead = period, distances[-1]
        return [_offset(distance, period) for distance in distances]

    def _require(self, period: int, interval: int, distances: Sequence[int]) -> None:
        """Refuse a rate that is too far off, and instants too far from their boundaries."""
        nominal = self.scale.nominal
        if abs(period - nominal) > nominal >> RATE:
            raise StampError(
                StampStatus.RATE,
                f"the stamps have an interval of {period / nominal:.4f} of the nominal one; up to 3 % more or less is "
                "allowed (sample_hz)",
            )
        worst = max(map(abs, distances))
        if worst * FARTHEST.denominator > interval:
            raise StampError(
                StampStatus.OFFSET,
                f"an instant lies {100 * worst / interval:.3g} % of a sampling interval from an even grid; up to "
                f"{float(100 * FARTHEST):g} % is allowed",
            )


def _offset(distance: int, interval: int) -> int:
    return (distance << OFFSET_BITS - 10) // (interval >> 10)
