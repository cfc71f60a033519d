"""What a log holds: its columns and what they mean, its sampling, every fault, and the command that runs it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import units
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import faults, meanings, reading, recording
from strapgen.lab.recordings.faults import Samples
from strapgen.lab.recordings.log_file import LogFile, LogTopic
from strapgen.lab.recordings.meanings import Meanings
from strapgen.lab.recordings.reading import Reading
from strapgen.lab.recordings.rest import rests
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

Array = NDArray[Any]

#: Most rows from which a meaning or a unit that the log leaves open is guessed.
_SEEN = 1 << 14
#: Rates that no gyro has in rad/s, and noise that none has, from sample to sample.
_MOST_RAD_S, _NOISE_RAD_S = 35.0, 0.03
#: Longest interval of a gyro in s, by which the unit of a time is guessed.
_LONGEST = 0.2
#: Equal extreme samples in a row that show the end of a range, and the share of rows above which they do not.
_AT_END, _MOST_AT_END = 3, 0.5
_AXES = ("x", "y", "z")
#: Names of columns that number the rows, and are no times.
_COUNTS = re.compile(r"count|packet|index|\bseq|frame|number|nummer")


@dataclass(frozen=True)
class LoggedColumn:
    """A column of a log."""

    name: str
    #: "time", "rate x", "increment x", "force x", "velocity increment x" or "attitude w"; null where it is not read
    meaning: str | None
    #: Null where the log states none and none is guessed
    unit: str | None


@dataclass(frozen=True)
class LoggedTable:
    """A table of a log."""

    name: str
    #: Type of its messages
    message: str
    #: Null where it is not known without reading
    rows: int | None


@dataclass(frozen=True)
class LoggedGap:
    """An interval in which samples are lost."""

    #: After the first row
    start_s: float
    seconds: float


@dataclass(frozen=True)
class LoggedRest:
    """An interval in which the gyro rests."""

    #: On the clock of the log
    start_s: float
    end_s: float
    #: Mean rates about x, y, z
    rate_deg_s: tuple[float, ...]


@dataclass(frozen=True)
class LogResult(Result):
    """What a log holds."""

    rows_in = "columns"

    file: str
    format: str
    topics: list[LoggedTable]
    #: The table of which the rest tells
    topic: str
    columns: list[LoggedColumn]
    #: Rows of that table
    samples: int | None
    duration_s: float | None
    rate_hz: float | None
    #: Root of the mean square of the departures of intervals from the mean, in parts of it
    jitter: float | None
    gaps: list[LoggedGap]
    #: Rows with the time of the row before
    repeats: int
    #: Rows whose time lies before that of the row before
    backwards: int
    #: Rows without a number
    nan: int
    #: Samples at the end of the gyro's range
    saturated: int
    #: Rows in which the gyro is stuck
    stuck: int
    rest: list[LoggedRest]
    #: What is to be said of the log, a sentence each
    remarks: list[str]
    #: The command that runs the log; null where it holds no rates
    command: str | None

    def table(self) -> TextTable:
        """Return the columns."""
        titles = (Column("column", "<"), Column("meaning", "<", missing=""), Column("unit", "<", missing=""))
        return TextTable(titles, [(one.name, one.meaning, one.unit) for one in self.columns])

    def text(self) -> str:
        """Return the tables, the columns, the sampling, what is odd, and the command."""
        lines = [f"{self.file}: {self.format}" + (f", topic {self.topic}" if self.topic else "")]
        if len(self.topics) > 1:
            titles = (Column("topic", "<"), Column("message", "<"), Column("rows", missing=""))
            table = TextTable(titles, [(one.name, one.message, one.rows) for one in self.topics])
            lines += ["", *table.lines()]
        lines += ["", *self.table().lines(), ""]
        if self.samples is not None:
            lines.append(f"{counted(self.samples, 'row')}, {self.duration_s:.6g} s")
        if self.rate_hz is not None:
            lines.append(
                f"{self.rate_hz:.6g} Hz, intervals {100 * (self.jitter or 0):.2g} % off the mean in rms"
            )
        lines += self.remarks
        for rest in self.rest:
            rates = ", ".join(f"{rate:.4g}" for rate in rest.rate_deg_s)
            begin, end = (f"{time:.5f}".rstrip("0").rstrip(".") for time in (rest.start_s, rest.end_s))
            lines.append(f"at rest from {begin} s to {end} s, mean rates {rates} deg/s")
        return "\n".join([*lines, *([] if self.command is None else ["", self.command])])


def survey(log: LogFile, topic: str, stated: Reading) -> LogResult:
    """Return what a log holds."""
    tables = [LoggedTable(one.name, one.message, one.rows) for one in log.topics]
    how, meaning, remarks = _understood(log, topic, stated)
    base = LogResult(
        *(str(log.path), log.format, tables, topic, [], None, None, None, None),
        *([], 0, 0, 0, 0, 0, [], [*log.remarks, *remarks], None),
    )
    if meaning is None:
        table = next((one for one in log.topics if one.name == topic or len(log.topics) == 1), None)
        columns = [] if table is None else _columns(table, None)
        return replace(base, columns=columns)
    one = next(one for one in log.topics if one.name == meaning.topic)
    with np.errstate(all="ignore"):
        samples, meaning, _, more = reading.loaded(log, meaning.topic, how)
        how, unit = _with_rate_unit(how, meaning, samples)
    by_kind = {fault.kind: fault for fault in samples.faults}
    saturated, at_end = _saturated(samples)
    repairs = [kind for kind in faults.REPAIRS if kind in by_kind]
    shown = replace(meaning, unit=meaning.unit or how.rate_unit)
    with suppress(InputError):
        shown, _ = replace(how, force=True).meanings(log, meaning.topic)
    how = replace(how, repair=repairs, gaps="bridge" if samples.gaps else "refuse")
    words = [f"{log.place(meaning.topic, one.row + samples.first)}: {one.words}" for one in samples.faults]
    texts = [*base.remarks, *(text for text in more if text not in base.remarks), *unit, *words, *at_end]
    gaps = [
        LoggedGap(float(samples.time[place - 1]), float(samples.time[place] - samples.time[place - 1]))
        for place, _ in samples.gaps
    ]
    return replace(
        base,
        topic=meaning.topic,
        columns=_columns(one, shown),
        samples=samples.read,
        duration_s=float(samples.time[-1] - samples.time[0]) if len(samples.time) else 0.0,
        rate_hz=1 / samples.interval if samples.interval else None,
        jitter=samples.jitter,
        gaps=gaps,
        repeats=samples.repeats,
        backwards=samples.backwards,
        nan=by_kind["nan"].rows if "nan" in by_kind else 0,
        saturated=saturated,
        stuck=by_kind["stuck"].rows if "stuck" in by_kind else 0,
        rest=_rests(log, meaning, how),
        remarks=texts,
        command=_command(log, topic or (meaning.topic if len(log.topics) > 1 else ""), how)
        if len(samples.time) > 1
        else None,
    )


def _understood(log: LogFile, topic: str, stated: Reading) -> tuple[Reading, Meanings | None, list[str]]:
    """Return how a log is read, what its columns mean if it has rates, and what is open."""
    try:
        meaning, remark = stated.meanings(log, topic)
    except InputError as error:
        if stated.columns is not None:
            raise
        text = str(error).removeprefix(f"{log.path}: ")
        guess = _guessed(log, topic, stated)
        if guess is None:
            return stated, None, [text]
        meaning, _ = guess.meanings(log, topic)
        how, more = _with_time_unit(log, guess, meaning)
        return how, meaning, [f"{text}; a guess is {guess.columns}", *more]
    how, more = _with_time_unit(log, stated, meaning)
    return how, meaning, [*([remark] if remark else []), *more]


def _guessed(log: LogFile, topic: str, stated: Reading) -> Reading | None:
    """Return the columns that are likely a time and three rates, for a user to judge; None where none are."""
    table = next((one for one in log.topics if one.name == topic or len(log.topics) == 1), None)
    if table is None or len(table.columns) < 4:
        return None
    read = log.read(table.name, table.names)
    values = {
        name: np.asarray(array[:_SEEN], float) for name, array in read.items() if array.dtype.kind in "fiu"
    }
    rising = [name for name, array in values.items() if _rises(array)]
    times = [name for name in rising if not _COUNTS.search(name.lower())]
    if not times:
        return None
    time = max(times, key=lambda name: bool(re.search("t|zeit|stamp", name.lower())))
    rest = [name for name in values if name not in rising]
    rest = rest if len(rest) > 2 else [name for name in values if name != time]
    if len(rest) < 3:
        return None
    threes = zip(rest, rest[1:], rest[2:], strict=False)
    orders = (order for three in threes for order in (three, three[::-1]))
    groups = [order for order in orders if _is_of_axes(order)]
    groups = [three for three in groups if not _is_force(np.column_stack([values[name] for name in three]))]
    chosen = groups[0] if groups else (rest[0], rest[1], rest[2])
    keys = ",".join(f"{key}={name}" for key, name in zip(("t", *_AXES), (time, *chosen), strict=True))
    return replace(stated, columns=keys)


def _rises(values: Array) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 0 and bool(np.mean(steps > 0) > 0.9)


def _is_of_axes(names: Sequence[str]) -> bool:
    """Return whether three names differ in one letter or word that stands for an axis."""
    sets = (_AXES, ("0", "1", "2"), ("1", "2", "3"), ("roll", "pitch", "yaw"), ("p", "q", "r"))
    lower = [name.lower() for name in names]
    return any(
        len({name.replace(word, "#", 1) for name, word in zip(lower, words, strict=True)}) == 1
        or len({"#".join(name.rsplit(word, 1)) for name, word in zip(lower, words, strict=True)}) == 1
        for words in sets
        if all(word in name for name, word in zip(lower, words, strict=True))
    )


def _is_force(values: Array) -> bool:
    """Return whether the length of vectors is near that of gravity."""
    typical = float(np.nanmedian(np.linalg.norm(values, axis=1)))
    return any(0.8 < typical / gravity < 1.2 for gravity in (9.80665, 1.0, 1000.0)) and _steady(values)


def _steady(values: Array) -> bool:
    length = np.linalg.norm(values, axis=1)
    return bool(np.nanstd(length) < 0.3 * np.nanmedian(length))


def _with_time_unit(log: LogFile, how: Reading, meaning: Meanings) -> tuple[Reading, list[str]]:
    """Return a reading with the unit of times that state none, by the length of an interval, and a remark."""
    if meaning.time is None or meaning.time_unit is not None:
        return how, []
    stamps = log.read(meaning.topic, [meaning.time])[meaning.time][:_SEEN]
    if stamps.dtype.kind == "M":
        return how, []
    stamps = np.asarray(stamps, float)
    steps = np.abs(np.diff(stamps[np.isfinite(stamps)]))
    typical = float(np.median(steps)) if len(steps) else 0.0
    unit = next((name for name, factor in units.TIMES.items() if typical * float(factor) <= _LONGEST), "ns")
    if unit == "s":
        return how, []
    remark = f"the times state no unit; by their intervals {unit} is a guess, which --time-unit states"
    return replace(how, time_unit=unit), [remark]


def _with_rate_unit(how: Reading, meaning: Meanings, samples: Samples) -> tuple[Reading, list[str]]:
    """Return a reading with the unit of rates that state none, by their size and noise, and a remark."""
    if meaning.unit is not None or meaning.input == "increments":
        return how, []
    seen = np.asarray(samples.values[:_SEEN, :3])
    noise = float(np.median(np.abs(np.diff(seen, axis=0)))) if len(seen) > 1 else 0.0
    is_deg = float(np.abs(seen).max(initial=0.0)) > _MOST_RAD_S or noise > _NOISE_RAD_S
    unit = "deg/s" if is_deg else "rad/s"
    remark = f"the rates state no unit; by their size {unit} is a guess, which --rate-unit states"
    return replace(how, rate_unit=unit), [remark]


def _columns(topic: LogTopic, meaning: Meanings | None) -> list[LoggedColumn]:
    """Return the columns of a topic with what they mean."""
    known: dict[str, str] = {}
    with suppress(InputError):
        found = meanings.attitude(topic)
        elements: tuple[str, ...] = ("w", *_AXES) if found.order == "sxyz" else (*_AXES, "w")
        elements = elements if found.order else ("roll", "pitch", "heading")
        known = {name: f"attitude {one}" for name, one in zip(found.columns, elements, strict=True)}
    of_units: dict[str, str | None] = {}
    if meaning is not None:
        names = ("increment", "velocity increment") if meaning.input == "increments" else ("rate", "force")
        for kind, columns in zip(names, (meaning.samples, meaning.forces), strict=True):
            known |= {name: f"{kind} {axis}" for name, axis in zip(columns, _AXES, strict=False)}
        if meaning.time is not None:
            known[meaning.time] = "time"
            of_units[meaning.time] = meaning.time_unit
        of_units |= dict.fromkeys(meaning.samples, meaning.unit) | dict.fromkeys(
            meaning.forces, meaning.force_unit
        )
    return [
        LoggedColumn(one.name, known.get(one.name), of_units.get(one.name) or one.unit)
        for one in topic.columns
    ]


def _saturated(samples: Samples) -> tuple[int, list[str]]:
    """Return the number of samples at the end of the gyro's range, and a remark."""
    values = np.abs(np.asarray(samples.values[:, :3]))
    at_end = values == values.max(axis=0, initial=0.0)
    in_a_row = at_end[2:] & at_end[1:-1] & at_end[:-2]
    axes = [k for k in range(3) if in_a_row[:, k].any() and at_end[:, k].mean() < _MOST_AT_END]
    count = int(at_end[:, axes].any(axis=1).sum())
    if not count:
        return 0, []
    largest = ", ".join(f"{_AXES[k]} {values[:, k].max():.6g}" for k in axes)
    return count, [
        f"{counted(count, 'sample')} at the largest magnitude, {largest}: the gyro's range may end there"
    ]


def _rests(log: LogFile, meaning: Meanings, how: Reading) -> list[LoggedRest]:
    """Return where the gyro rests; nothing where the log cannot be read even with all repairs."""
    try:
        data = recording.recording_of(log, meaning.topic, replace(how, force=False))
        found = rests(data)
    except InputError:
        return []
    return [
        LoggedRest(one.start_s, one.end_s, tuple(float(rate) for rate in np.degrees(one.rate)))
        for one in found
    ]


def _command(log: LogFile, topic: str, how: Reading) -> str:
    """Return the command that runs a log."""
    words = ["strapgen", "simulate", "euler", "--recording", f"{Path(log.path)}{':' if topic else ''}{topic}"]
    options = {
        "--input": how.input,
        "--columns": how.columns,
        "--time-unit": how.time_unit,
        "--rate-unit": how.rate_unit,
        "--sample-hz": how.sample_hz,
        "--gaps": None if how.gaps == "refuse" else how.gaps,
        "--repair": ",".join(how.repair) or None,
    }
    for name, value in options.items():
        words += [] if value is None else [name, str(value)]
    return shlex.join(words)
