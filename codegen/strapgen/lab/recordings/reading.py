"""Reads the samples of a log as angle and velocity increments at even intervals."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks, units
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import faults, meanings
from strapgen.lab.recordings.faults import Samples
from strapgen.lab.recordings.log_file import LogFile
from strapgen.lab.recordings.long_columns import Columns, SideBySide, parts
from strapgen.lab.recordings.meanings import INPUTS, Meanings, Stated, known_unit

Array = NDArray[Any]

#: From this interval on times in no stated unit may be in ms, us, ns or numbers of packets, in s.
_LONG_INTERVAL = 0.5
#: Most samples of a recording, with those that are put in.
_MOST_SAMPLES = 50_000_000
#: Binary digits of an interval in ticks, and pairs of samples, on an even grid.
_GRID_BITS, _GRID_PAIRS = 26, (7, 7)


@dataclass(frozen=True)
class Reading:
    """How the samples of a log are read, as `strapgen.read` has it."""

    input: str | None = None
    columns: str | None = None
    time_unit: str | None = None
    rate_unit: str | None = None
    force_unit: str | None = None
    sample_hz: float | str | Fraction | None = None
    axes: str | None = None
    start: float | str | Fraction | None = None
    end: float | str | Fraction | None = None
    every: int = 1
    gaps: str = "refuse"
    repair: Sequence[str] = ()
    force: bool = False
    #: Frequency that a number of whole samples comes nearest to, however uneven they are
    near_hz: float | str | Fraction | None = None
    #: Whether the times are instants of the samples, which are taken to an even grid
    grid: bool = False

    def __post_init__(self) -> None:
        if self.input is not None:
            checks.choice("input", self.input, INPUTS)
        checks.choice("gaps", self.gaps, faults.GAPS)
        checks.count("every", self.every)
        for name, table in (("rate", units.RATES), ("time", units.TIMES), ("force", units.FORCES)):
            if (unit := getattr(self, f"{name}_unit")) is not None:
                known_unit(f"{name} unit", unit, table)
        if self.near_hz is not None:
            checks.number("resample_hz", self.near_hz, positive=True)
        _turned(self.axes)

    @classmethod
    def of(cls, options: Mapping[str, Any], **stated: Any) -> Reading:
        """Return the reading of keywords of a user, beside those that are stated already."""
        allowed = [field.name for field in fields(cls) if field.name not in (*stated, "near_hz")]
        for name in options:
            checks.choice("keyword", name, allowed)
        return cls(**stated, **options)

    @property
    def repaired(self) -> tuple[str, ...]:
        """The faults that are repaired."""
        words = self.repair.split(",") if isinstance(self.repair, str) else self.repair
        for word in words:
            checks.choice("repair", word, (*faults.REPAIRS, "all"))
        return faults.REPAIRS if "all" in words else tuple(words)

    def meanings(self, log: LogFile, topic: str) -> tuple[Meanings, str]:
        """Return what the columns of a log mean, and a remark."""
        of_input = "rates" if self.input == "instants" else self.input
        stated = Stated(
            *(of_input, self.columns, self.time_unit, self.rate_unit, self.force_unit),
            has_time=self.sample_hz is None,
            with_force=self.force,
        )
        if not any(one.columns for one in log.topics):
            raise InputError(f"{log.path} holds 0 rows of numbers; at least 2 are needed")
        try:
            found, remark = meanings.find(log.topics, topic, stated)
        except InputError as error:
            raise InputError(f"{log.path}: {error}") from None
        return found, remark


class Increments(NamedTuple):
    """What a log holds, as increments."""

    #: Time at which the first one begins, and the interval, in s
    start: float
    interval: float
    #: (N, 3): in rad and m/s; None without specific forces
    angle: Array
    velocity: Array | None
    remarks: tuple[str, ...]
    #: The first increments of the pieces after the first one, and the times at which they begin in s
    breaks: tuple[tuple[int, float], ...]


def loaded(log: LogFile, topic: str, reading: Reading) -> tuple[Samples, Meanings, float, list[str]]:
    """Return the samples of a log with the faults that it has, what they are, the first time in s, and remarks."""
    meaning, remark = reading.meanings(log, topic)
    wanted = meaning.columns
    read = log.read(meaning.topic, wanted)
    count = len(read[wanted[0]])
    if count < 2:
        raise InputError(f"{log.path} holds {counted(count, 'row')} of numbers; at least 2 are needed")
    values: Any = SideBySide([read[name] for name in (*meaning.samples, *meaning.forces)])
    begin, time = _times(log, read, meaning, reading, count)
    first, last = _between(time, reading.start, reading.end)
    if last - first < 2:
        raise InputError(
            f"{log.path} holds {counted(last - first, 'row')} between --start and --end; 2 are needed"
        )
    names = [*([] if meaning.time is None else [meaning.time]), *meaning.samples, *meaning.forces]
    keep_times = reading.near_hz is not None or reading.grid
    samples = faults.examined(time[first:last], values[first:last], names, keep_times=keep_times)
    samples.first = first
    return samples, meaning, begin, [*log.remarks, *([remark] if remark else [])]


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def increments(log: LogFile, topic: str, reading: Reading) -> Increments:
    """Return the increments of a log."""
    samples, meaning, begin, remarks = loaded(log, topic, reading)

    def place(row: int) -> str:
        return log.place(meaning.topic, row + samples.first)

    faults.refuse(samples, lambda row: f"{log.path}, {place(row)}", reading.repaired, reading.gaps)
    if len(samples.time) < 2:
        raise InputError(
            f"{log.path} holds {counted(len(samples.time), 'sample')} without faults; 2 are needed"
        )
    remarks += [f"{place(one.row)}: {one.words}" for one in samples.faults]
    is_split = reading.gaps == "split"
    faults.bridged(
        samples, [gap for gap in samples.gaps if not is_split or gap[0] in samples.restored], _MOST_SAMPLES
    )
    remarks += samples.remarks
    kind = "instants" if reading.input == "instants" else meaning.input
    if kind != "increments" and meaning.unit is None:
        raise InputError(
            f"{log.path} states no unit of the rates; --rate-unit is needed, {', '.join(units.RATES)}"
        )
    if meaning.forces and kind != "increments" and meaning.force_unit is None:
        raise InputError(
            f"{log.path} states no unit of the forces; --force-unit is needed, {', '.join(units.FORCES)}"
        )
    edges = [0, *(place for place, _ in samples.gaps), len(samples.time)]
    every = _every(reading, samples.interval, len(samples.time), remarks)
    table, breaks, left = Columns(samples.values.shape[1]), [], 0
    for first, last in pairwise(edges):
        before = table.rows
        if reading.grid:
            with _at_time(log, begin, samples.time[first:last]):
                rows = iter([_on_grid(samples, (first, last), kind, remarks)])
        else:
            rows = _rows(samples, (first, last), kind)
        left += _summed(table, rows, every)
        starts_before = kind != "instants" and not reading.grid
        start = float(samples.time[first]) - (samples.interval if starts_before else 0.0)
        if table.rows > before:
            breaks.append((before, begin + start))
    if not breaks:
        raise InputError(f"{log.path} holds no piece of {every} samples")
    remarks += _of_kind(kind, len(samples.time), table.rows, samples, reading.grid)
    if left and every > 1:
        remarks.append(f"{counted(left, 'increment')} left out, which fill no sum of {every}")
    if len(breaks) > 1:
        remarks.append(f"it is split into {len(breaks)} pieces")
    factors = [1.0] * 6  # of increments, in rad and m/s
    if kind != "increments":
        of_rate, of_force = units.RATES[meaning.unit or "rad/s"], units.FORCES[meaning.force_unit or "m/s^2"]
        factors = [float(of_rate)] * 3 + [float(of_force)] * (table.width - 3)
    angle, velocity = _turned_and_scaled(table, factors, reading.axes)
    if not all(
        np.isfinite(part).all()
        for array in (angle, velocity)
        if array is not None
        for _, part in parts(array)
    ):
        raise InputError(f"{log.path}: the integral of a rate is beyond the range of double")
    return Increments(
        breaks[0][1], samples.interval * every, angle, velocity, tuple(remarks), tuple(breaks[1:])
    )


def _times(
    log: LogFile, read: dict[str, Array], meaning: Meanings, reading: Reading, count: int
) -> tuple[float, Array]:
    """Return the first time in s, and all times after it; stamps of whole numbers keep all their digits."""
    times = Columns(1)
    if meaning.time is None:
        step = 1 / float(checks.number("sample_hz", reading.sample_hz or 0, positive=True))
        for first in range(0, count, 1 << 18):
            times.append(step * np.arange(first, min(first + (1 << 18), count)))
        return 0.0, times.array()[:, 0]
    stamps = read[meaning.time]
    unit = meaning.time_unit
    if stamps.dtype.kind == "M":
        stamps, unit = stamps.astype("datetime64[ns]").astype(np.int64), "ns"
    factor = float(units.TIMES[unit or "s"])
    finite = stamps[:1] if np.isfinite(stamps[0]) else stamps[np.isfinite(stamps)][:1]
    begin = finite[0] if len(finite) else stamps[0]
    for _, part in parts(stamps):
        wide = part.astype(np.int64) if part.dtype.kind in "iu" else part
        times.append((wide - wide.dtype.type(begin)).astype(np.float64) * factor)
    time = times.array()[:, 0]
    if not math.isfinite(float(time[-1] - time[0])) and np.isfinite(np.asarray(stamps[[0, -1]], float)).all():
        low, high = (float(stamps[k]) * factor for k in (0, -1))
        raise InputError(f"{log.path}: times from {low:g} s to {high:g} s are too far apart")
    if unit is None and stamps.dtype.kind != "M":
        with np.errstate(over="ignore"):
            typical = float(np.median(np.abs(np.diff(time[: 1 << 12]))))
        if _LONG_INTERVAL <= typical < np.inf:
            raise InputError(
                f"{log.path}: the time states no unit and grows by {typical:g} from row to row; --time-unit s, ms, us "
                "or ns says what it is, or --sample-hz the sampling rate"
            )
    return float(begin) * factor, time


def _between(time: Array, start: Any, end: Any) -> tuple[int, int]:
    """Return the first row from a time in s on, and the first one after another."""
    first, last = 0, len(time)
    if start is not None:
        late = np.flatnonzero(time >= float(checks.number("start", start)))
        first = int(late[0]) if len(late) else last
    if end is not None:
        late = np.flatnonzero(time > float(checks.number("end", end)))
        last = int(late[0]) if len(late) else last
    return first, max(first, last)


def _every(reading: Reading, interval: float, count: int, remarks: list[str]) -> int:
    """Return how many samples are summed into one."""
    if reading.near_hz is None:
        return int(reading.every)
    ratio = 1 / (interval * float(checks.number("resample_hz", reading.near_hz, positive=True)))
    if not ratio < count:
        raise InputError(f"resample_hz {reading.near_hz} makes no whole increment of {count} samples")
    every = max(1, round(ratio))
    remarks.append(
        f"{counted(every, 'whole sample')} make an increment, {1 / (interval * every):.6g} Hz; --every {every} says so"
    )
    return every


def _summed(table: Columns, pieces: Iterator[Array], every: int) -> int:
    """Add increments, as many summed as stated; return how many are left over in the end."""
    waiting = np.empty((0, table.width))
    for rows in pieces:
        if every > 1:
            rows = np.concatenate([waiting, rows])
            whole = len(rows) // every * every
            rows, waiting = rows[:whole].reshape(-1, every, table.width).sum(axis=1), rows[whole:]
        table.append(rows)
    return len(waiting)


def _rows(
    samples: Samples, edges: tuple[int, int], kind: str, *, even: bool | None = None
) -> Iterator[Array]:
    """Yield the increments of one piece, whose times are even ones or not, by default as far as they depart."""
    first, last = edges
    is_even = samples.departure <= faults.EVEN if even is None else even
    for begin, part in parts(samples.values[first:last], int(kind == "instants")):
        time = np.asarray(samples.time[first + begin : first + begin + len(part)])
        if kind == "increments":
            rows = part
        elif kind == "instants":
            rows = (part[1:] + part[:-1]) / 2 * np.diff(time)[:, None]
        elif is_even:
            rows = part * samples.interval
        else:
            before = time[0] - samples.interval if begin == 0 else samples.time[first + begin - 1]
            rows = part * np.diff(time, prepend=before)[:, None]
        yield rows


def _on_grid(samples: Samples, edges: tuple[int, int], kind: str, remarks: list[str]) -> Array:
    """Return the increments of one piece on an even grid, from the first time to the last."""
    from strapgen.stamped.stamped_grid import StampedGrid  # loads SymPy

    first, last = edges
    rows = np.concatenate([*_rows(samples, edges, kind, even=False)])
    rows = rows[len(rows) - (last - first) + 1 :]
    # Ticks of about 2^-26 of an interval.
    ticks_hz = 2.0 ** round(_GRID_BITS - math.log2(samples.interval))
    stamps = np.rint((samples.time[first:last] - samples.time[first]) * ticks_hz).astype(np.int64)
    if len(stamps) < 3:
        return rows
    grid = StampedGrid(1 / samples.interval, ticks_hz, _GRID_PAIRS)
    whole = [grid.whole(rows[:, k : k + 3], stamps) for k in range(0, rows.shape[1], 3)]
    halves = " and ".join(f"{rate:.9g}" for rate in whole[0].halves)
    remarks.append(
        f"{len(rows)} increments are taken from their instants to an even grid, {1 / whole[0].interval:.9g} Hz; by "
        f"halves {halves} Hz"
    )
    return np.hstack([one.samples for one in whole])


@contextmanager
def _at_time(log: LogFile, begin: float, time: Array) -> Iterator[None]:
    """Name the time of a stamp that the grid cannot take."""
    from strapgen.stamped.grid_clock import StampError

    try:
        yield
    except StampError as error:
        place = f"at {begin + float(time[error.place or 0]):.9g} s"
        raise InputError(
            f"{log.path}, {place}: {error.reason}; without --grid the times are taken as even"
        ) from None


def _of_kind(kind: str, rows: int, count: int, samples: Samples, is_on_grid: bool) -> list[str]:
    """Return remarks on what is taken for what."""
    texts = {
        "increments": [],
        "rates": [f"{rows} rates are means over the intervals that end at their times, {count} increments"],
        "instants": [
            f"{rows} rates at instants make {count} increments by the trapezoid, whose error is of second order in the "
            "interval"
        ],
    }[kind]
    if samples.departure > faults.EVEN and not is_on_grid:
        texts.append(
            f"sample times depart from even ones by up to {100 * samples.departure:.2g} % of an interval, and the "
            "increments count as even"
        )
    return texts


def _turned(axes: str | None) -> tuple[tuple[int, float], ...]:
    """Return the columns and signs of the body's axes x, y, z."""
    if axes is None:
        return ((0, 1.0), (1, 1.0), (2, 1.0))
    words = [re.fullmatch(r"([-+]?)([xyz])", word.strip()) for word in axes.split(",")]
    found = tuple(("xyz".index(word[2]), -1.0 if word[1] == "-" else 1.0) for word in words if word)
    if len(words) != 3 or sorted(place for place, _ in found) != [0, 1, 2]:
        raise InputError(f"axes is {axes!r}; each of x, y, z once is needed, perhaps with a sign, as x,-y,-z")
    matrix = np.zeros((3, 3))
    for row, (place, sign) in enumerate(found):
        matrix[row, place] = sign
    if np.linalg.det(matrix) < 0:
        raise InputError(f"axes {axes} is a left-handed set; a right-handed one is needed, as x,-y,-z")
    return found


def _turned_and_scaled(
    table: Columns, factors: Sequence[float], axes: str | None
) -> tuple[Array, Array | None]:
    """Return angle and velocity increments in body axes, in rad and m/s."""
    whole, turned = table.array(), _turned(axes)
    results = []
    for begin in range(0, table.width, 3):
        places = [begin + place for place, _ in turned]
        signs = np.array([sign * factors[begin] for _, sign in turned])
        if places == [*range(table.width)] and (signs == 1).all():
            return whole, None
        columns = Columns(3)
        for _, part in parts(whole):
            columns.append(part[:, places] * signs)
        results.append(columns.array())
    return results[0], results[1] if len(results) > 1 else None
