"""Finds the faults of recorded samples, each named and counted once, and repairs them.

Rows are left out or put in, times are set right; what is restored in place of a lost sample follows from the samples
on both sides. A caller decides which of the faults are allowed.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.long_columns import Columns, parts

Array = NDArray[Any]

REPAIRS = ("repeats", "order", "clock", "nan", "stuck")
GAPS = ("refuse", "split", "bridge")
#: Largest relative departure of an interval from the mean in an even recording, and in one whose stamps are good.
EVEN, UNEVEN = 1e-3, 0.1
#: From this multiple of the mean on, samples are lost in an interval.
_LOST = 1.5
#: Equal rows in a row from which on a gyro is stuck, and the share of equal neighbours above which it is not: it rests.
_STUCK, _RESTING = 16, 0.1
#: Rows by which one is displaced at most where rows are out of order; a clock is set back by more.
_DISPLACED = 64
#: Share of rows with the time of the row before from which on the clock is coarse.
_COARSE = 0.1
#: Intervals of a block whose mean is one value, rows on both sides that tell a gap from a late stamp; most blocks.
_BLOCK = 64
_BLOCKS = 1 << 12
#: Samples on each side that restore a lost one, the band in which they do, and the weight of the squares of the taps.
REACH, _BAND, _POINTS, _WEIGHT = 8, 1.3, 400, 1e-16


class Fault(NamedTuple):
    """A kind of fault in a recording."""

    kind: str  # of `REPAIRS`, or "gap"
    rows: int  # that have it, or gaps
    row: int  # the first row that has it, counted in the file
    words: str  # what is wrong there, after "line 17: "


@dataclass
class Samples:
    """Samples with their times, while faults are taken out of them."""

    #: (N,): in s after the first
    time: Array
    #: (N, 3) or (N, 6)
    values: Array
    #: (N,): numbers of the rows in the file; None where they are all
    rows: Array | None = None
    faults: list[Fault] = field(default_factory=list)
    #: Rows before which samples were left out that are to be restored
    restored: list[int] = field(default_factory=list)
    #: Mean sampling interval in s
    interval: float = 0.0
    #: Rows before which samples are lost, and how many
    gaps: list[tuple[int, int]] = field(default_factory=list)
    #: Largest departure of an interval from the mean, in parts of it
    departure: float = 0.0
    #: Root of the mean square of these departures
    jitter: float = 0.0
    #: Rows that are read, those whose time lies before that of the row before, and those with its time
    read: int = 0
    backwards: int = 0
    repeats: int = 0
    #: Number in the file of the first row that is read
    first: int = 0
    #: What restored samples are, a sentence each
    remarks: list[str] = field(default_factory=list)

    def row(self, place: int) -> int:
        """Return the number in the file of a row."""
        return place if self.rows is None else int(self.rows[place])

    def note(self, kind: str, count: int, place: int, words: str) -> None:
        """Note a fault that is seen first at a place."""
        self.faults.append(Fault(kind, count, self.row(place), words))

    def keep(self, kept: Array, restored: Sequence[int] = ()) -> None:
        """Leave rows out: `kept` (N,) are those that stay, or their numbers in a new order."""
        numbers = np.flatnonzero(kept) if kept.dtype == bool else kept
        self.time, self.values = _taken(self.time, numbers), _taken(self.values, numbers)
        before = np.asarray([*self.restored, *restored], np.int64)
        places = np.searchsorted(numbers, before) if kept.dtype == bool else before
        self.restored = sorted({*map(int, places[(places > 0) & (places < len(numbers))])})
        self.rows = numbers if self.rows is None else self.rows[numbers]


def examined(time: Array, values: Array, names: Sequence[str], *, keep_times: bool = False) -> Samples:
    """Return samples without their faults, which are noted; lost samples are not put in yet, see `bridged`.

    `time` (N,): in s. `values` (N, K). `names`: of the time and the values, for what is said of a fault. `keep_times`:
    whether times are right however uneven they are.
    """
    samples = Samples(time, values, read=len(time))
    _take_out_not_finite(samples, names)
    if len(samples.time) < 2:
        return samples
    _put_in_order(samples)
    is_coarse = _take_out_repeated(samples)
    if len(samples.time) >= 2:
        _take_out_stuck(samples)
    if len(samples.time) >= 2:
        _find_gaps(samples, is_coarse, keep_times)
    return samples


def refuse(samples: Samples, where: Callable[[int], str], repair: Container[str], gaps: str) -> None:
    """Refuse the first fault that is not to be repaired."""
    for fault in samples.faults:
        if fault.kind == "gap":
            if gaps == "refuse":
                raise InputError(
                    f"{where(fault.row)}: {fault.words}; --gaps split or --gaps bridge allows it"
                )
        elif fault.kind not in repair:
            raise InputError(f"{where(fault.row)}: {fault.words}; --repair {fault.kind} allows it")


def _take_out_not_finite(samples: Samples, names: Sequence[str]) -> None:
    bad: list[Array] = []
    for (first, time), (_, values) in zip(parts(samples.time), parts(samples.values), strict=True):
        if not np.isfinite(time.sum() + values.sum()):
            good = np.isfinite(time) & np.isfinite(values).all(axis=1)
            bad.append(first + np.flatnonzero(~good))
    if not (rows := np.concatenate([np.empty(0, np.int64), *bad])).size:
        return
    first = int(rows[0])
    cells = [samples.time[first], *samples.values[first]]
    name, cell = next(
        (name, cell) for name, cell in zip(names, cells[-len(names) :], strict=True) if not np.isfinite(cell)
    )
    several = "" if len(rows) == 1 else f"; {len(rows)} rows hold none"
    samples.note("nan", len(rows), first, f"column {name} is {cell:g}; a finite number is needed{several}")
    kept = np.ones(len(samples.time), bool)
    kept[rows] = False
    samples.keep(kept, [*map(int, rows)])


def _put_in_order(samples: Samples) -> None:
    back = _places(samples.time, lambda gaps: gaps < 0)
    if not back.size:
        return
    samples.backwards = len(back)
    first = int(back[0]) + 1
    words = (
        f"its time lies {samples.time[first - 1] - samples.time[first]:.6g} s before that of the row before"
    )
    if not _places(samples.time, lambda gaps: gaps > 0).size:
        samples.note("order", len(back), first, f"{words}: all rows run backwards in time")
        count = len(samples.time)
        samples.restored = [count - place for place in samples.restored]
        samples.keep(np.arange(count)[::-1])
        return
    order = np.argsort(samples.time, kind="stable")
    if np.abs(order - np.arange(len(order))).max() <= _DISPLACED:
        samples.note("order", len(back), first, f"{words}; {counted(len(back), 'row')} out of order")
        samples.keep(order)
        return
    samples.note("clock", len(back), first, f"{words}: the clock is set back, {counted(len(back), 'time')}")
    time = np.array(samples.time)
    typical = float(np.median(np.abs(np.diff(time))))
    for place in map(int, back):
        time[place + 1 :] += time[place] + typical - time[place + 1]
    samples.time = time


def _take_out_repeated(samples: Samples) -> bool:
    """Leave out rows with the time of the row before; return whether they are too many for that."""
    repeated = _places(samples.time, lambda gaps: gaps == 0)
    if not repeated.size:
        return False
    samples.repeats = len(repeated)
    first = int(repeated[0]) + 1
    words = "its time is that of the row before"
    if len(repeated) > _COARSE * len(samples.time) and samples.time[-1] > samples.time[0]:
        samples.note(
            "clock", len(repeated), first, f"{words}, as in {len(repeated)} rows: the clock is coarse"
        )
        return True
    samples.note(
        "repeats",
        len(repeated),
        first,
        f"{words}; {counted(len(repeated), 'row')} {'repeats' if len(repeated) == 1 else 'repeat'} a time",
    )
    kept = np.ones(len(samples.time), bool)
    kept[repeated + 1] = False
    samples.keep(kept)
    return False


def _take_out_stuck(samples: Samples) -> None:
    found: list[Array] = []
    for first, part in parts(samples.values, 1):
        places = np.flatnonzero(part[1:, 0] == part[:-1, 0])
        found.append(first + 1 + places[(part[places + 1, :3] == part[places, :3]).all(axis=1)])
        if sum(map(len, found)) > _RESTING * len(samples.values):
            return
    equal = np.concatenate(found)
    if not equal.size:
        return
    begins = np.flatnonzero(np.diff(equal, prepend=-2) > 1)
    ends = np.append(begins[1:], len(equal))
    runs = [
        (int(equal[begin]), int(equal[end - 1]) + 1)
        for begin, end in zip(begins, ends, strict=True)
        if end - begin >= _STUCK - 1
    ]
    if not runs:
        return
    count = sum(end - begin for begin, end in runs)
    first = runs[0][0]
    words = f"the same values in {runs[0][1] - first + 1} rows: the gyro is stuck"
    several = f"; {count} rows in {len(runs)} places" if len(runs) > 1 else ""
    samples.note("stuck", count, first - 1, words + several)
    kept = np.ones(len(samples.time), bool)
    for begin, end in runs:
        kept[begin:end] = False
    samples.keep(kept, [begin for begin, _ in runs])


def mean_interval(time: Array) -> float:
    """Return the sampling interval: the median of means of blocks, on which late stamps and gaps have no effect."""
    if len(time) <= 2 * _BLOCK:
        typical = float(np.median(np.diff(time)))
        return typical if typical > 0 else float(time[-1] - time[0]) / (len(time) - 1)
    begins = np.linspace(0, len(time) - 1 - _BLOCK, min(len(time) - _BLOCK, _BLOCKS)).astype(np.int64)
    return float(np.median(time[begins + _BLOCK] - time[begins])) / _BLOCK


def _find_gaps(samples: Samples, is_coarse: bool, keep_times: bool) -> None:
    """Find lost samples, and times that are no sensor's."""
    time = samples.time
    typical = float(time[-1] - time[0]) / (len(time) - 1) if is_coarse else mean_interval(time)
    long = _places(time, lambda gaps: gaps > _LOST * typical)
    uneven = _places(
        time, lambda gaps: (np.abs(gaps - typical) > UNEVEN * typical) & (gaps <= _LOST * typical)
    )
    if (
        uneven.size or is_coarse
    ):  # a stamp that is late is followed by a short interval, a lost sample by an even one
        gaps = _lasting_delays(time, typical)
        long = np.array([place - 1 for place, _ in gaps], np.int64)
        samples.interval = float(time[-1] - time[0]) / (len(time) - 1 + sum(count for _, count in gaps))
    else:
        steps = np.diff(time)[long] if long.size else np.empty(0)
        samples.interval = (float(time[-1] - time[0]) - float(steps.sum())) / max(
            1, len(time) - 1 - len(long)
        )
        if not 0 < samples.interval < np.inf:
            samples.interval = typical
        lost = np.maximum(np.rint(steps / samples.interval) - 1, 1)
        gaps = [(int(k) + 1, int(count)) for k, count in zip(long, lost, strict=True)]
    samples.gaps, interval = gaps, samples.interval
    worst, squares = 0, 0.0
    for first, part in parts(time, 1):
        departures = np.abs(np.diff(part) - interval) / interval
        departures[long[(long >= first) & (long < first + len(departures))] - first] = 0
        place = int(departures.argmax())
        squares += float(departures @ departures)
        if departures[place] > samples.departure:
            samples.departure, worst = float(departures[place]), first + place
    samples.jitter = float(np.sqrt(squares / (len(time) - 1)))
    if (uneven.size or is_coarse) and not keep_times:
        if not is_coarse:
            step = float(time[worst + 1] - time[worst])
            samples.note(
                *("clock", len(uneven), worst + 1),
                f"sample times are not even: the interval of {step:.6g} s before it is the worst, the mean is "
                f"{interval:.6g} s",
            )
        _make_even(samples)
    lost = [gap for gap in samples.gaps if gap[0] not in samples.restored]
    if lost:
        place, _ = max(lost, key=lambda gap: gap[1])
        step = float(time[place] - time[place - 1])
        total = sum(count for _, count in lost)
        samples.note(
            *("gap", len(lost), place),
            f"a gap of {step:.6g} s, the mean interval is {interval:.6g} s; {counted(total, 'sample')} lost in "
            f"{counted(len(lost), 'place')}",
        )


def _lasting_delays(time: Array, typical: float) -> list[tuple[int, int]]:
    """Return the rows from which on the times stay behind, as they do after lost samples, and how many those are."""
    late = time / typical - np.arange(len(time))
    found: dict[int, int] = {}
    for place in map(int, np.flatnonzero(np.diff(late) > (_LOST - 1) / 2) + 1):
        first = max(0, place - _BLOCK)
        before, after = late[first:place], late[place : place + _BLOCK]
        count = round(float(after.min() - before.min()))
        if count < 1 or len(after) < _BLOCK // 4:  # near the end a late stamp may be no gap
            continue
        # Stamps may be late before the gap too: the last that is not is the last row before it.
        row = first + int(np.flatnonzero(before <= before.min() + _LOST - 1)[-1]) + 1
        found[row] = max(count, found.get(row, 0))
    return sorted(found.items())


def _make_even(samples: Samples) -> None:
    """Set the times of samples even between gaps."""
    edges = [0, *(place for place, _ in samples.gaps), len(samples.time)]
    time = np.empty(len(samples.time))
    for begin, end in pairwise(edges):
        even = samples.interval * np.arange(end - begin)
        time[begin:end] = even + np.mean(samples.time[begin:end] - even)
    samples.time, samples.departure = time, 0.0
    samples.remarks.append(f"its times are taken as even, {1 / samples.interval:.9g} Hz")


def _places(time: Array, holds: Callable[[Array], Array]) -> Array:
    """Return the numbers of the intervals for which something holds."""
    found = [first + np.flatnonzero(holds(np.diff(part))) for first, part in parts(time, 1)]
    return np.concatenate([np.empty(0, np.int64), *found])


def _taken(array: Array, numbers: Array) -> Array:
    """Return rows of an array by their numbers."""
    columns = Columns(1 if array.ndim == 1 else array.shape[1])
    for first, part in parts(numbers):
        del first
        columns.append(array[part])
    taken = columns.array()
    return taken[:, 0] if array.ndim == 1 else taken


def bridged(samples: Samples, gaps: Sequence[tuple[int, int]], most: int) -> None:
    """Put in samples in place of those lost before some rows.

    A single one among good ones follows from the filter of `restoring_taps`; others are on the line between the samples
    on both sides.
    """
    if not gaps:
        return
    lost = sum(count for _, count in gaps)
    if len(samples.time) + lost > most:
        raise InputError(f"{lost} lost samples are too many to put in; --gaps split leaves gaps as they are")
    time, values = Columns(1), Columns(samples.values.shape[1])
    edges = np.array([0, *(place for place, _ in samples.gaps), len(samples.time)])
    taps, begin, filtered, put_in = restoring_taps(), 0, 0, 0
    left = dict(samples.gaps)
    moved = []
    for place, count in gaps:
        moved += [(other + put_in, left.pop(other)) for other in [*left] if other < place]
        left.pop(place, None)
        share = np.arange(1, count + 1) / (count + 1)
        is_alone = count == 1 and np.count_nonzero(np.abs(edges - place) < REACH) == 1
        for columns, array in ((time, samples.time), (values, samples.values)):
            columns.append(array[begin:place])
            line = np.multiply.outer(1 - share, array[place - 1]) + np.multiply.outer(share, array[place])
            if is_alone and columns is values:
                line = taps @ array[place - REACH : place + REACH]
            columns.append(line)
        filtered += is_alone
        begin, put_in = place, put_in + count
    moved += [(other + put_in, count) for other, count in left.items()]
    time.append(samples.time[begin:])
    values.append(samples.values[begin:])
    samples.time, samples.values, samples.rows, samples.gaps = time.array()[:, 0], values.array(), None, moved
    samples.remarks += [
        text
        for count, text in (
            (
                filtered,
                f"{counted(filtered, 'lost sample')} restored by a filter of {REACH} samples on each side",
            ),
            (
                lost - filtered,
                f"{counted(lost - filtered, 'lost sample')} put on the line between neighbours",
            ),
        )
        if count
    ]


@cache
def restoring_taps() -> Array:
    """Return the filter that restores a lost sample from `REACH` on each side, (2 `REACH`).

    Over the band the response of the taps is nearest to that of the sample itself; their sum is 1.

    >>> taps = restoring_taps()
    >>> taps.shape, bool(abs(taps.sum() - 1) < 1e-12)
    ((16,), True)
    """
    b = _BAND * (np.arange(_POINTS) + 0.5) / _POINTS
    size = np.sinc(b / (2 * np.pi))
    cosines = 2 * np.cos(np.multiply.outer(b, np.arange(1, REACH + 1)))
    # One tap follows from the sum of all: 2 sum f = 1.
    rows = (cosines[:, 1:] - cosines[:, :1]) * size[:, None]
    wanted = (1 - cosines[:, 0] / 2) * size
    small = np.sqrt(_WEIGHT * _POINTS) * np.eye(REACH - 1)
    rest = np.linalg.lstsq(
        np.vstack([rows, small]), np.concatenate([wanted, np.zeros(REACH - 1)]), rcond=None
    )[0]
    half = np.array([0.5 - rest.sum(), *rest])
    return np.concatenate([half[::-1], half])
