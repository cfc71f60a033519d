"""Reads recorded gyro data from files, as increments or rates, and runs an algorithm along it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks, units
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.renamed import renamed
from strapgen.lab.recordings.recorded_header import (
    ColumnLayout,
    known_unit,
    named_layout,
    rates_layout,
)
from strapgen.lab.recordings.recorded_rows import (
    PART,
    Columns,
    LineNumbers,
    RecordedRows,
    SampleIntervals,
    largest_magnitude,
    parts,
    read_rows,
    release,
)
from strapgen.lab.runs import require_finite, require_proper
from strapgen.run.backends import Backend
from strapgen.run.increments import StepWindows

Array = NDArray[np.float64]

#: Units of recorded rates, and their factor to rad/s.
RATE_UNITS = {name: float(factor) for name, factor in units.RATES.items()}

#: Names of columns, and their units.
_INCREMENT_COLUMNS = {"t": "s", "dx": "rad", "dy": "rad", "dz": "rad"}
_INERTIAL_COLUMNS = {**_INCREMENT_COLUMNS, "dvx": "m/s", "dvy": "m/s", "dvz": "m/s"}
#: Largest relative departure of an interval from the median in an even recording.
_EVEN = 1e-3

#: From this multiple of the median on, an interval is a gap in which the motion is not known.
GAP = 10


@renamed(increments="samples")
@dataclass(frozen=True)
class Recording(ReadOnly):
    """Angle increments at even intervals.

    Parameters
    ----------
    start : float
        Time in s at which the first increment begins.
    interval : float
        Sampling interval in s.
    samples : array, (N, 3)
        Angle increments in rad, body axes.
    remarks : tuple of str, optional
        What was left out of the file or taken in place of what it lacks, a sentence each.

    Examples
    --------
    >>> Recording(0.0, 0.01, np.full((4, 3), 1e-3)).largest
    0.001
    """

    start: float
    interval: float
    samples: Array
    remarks: tuple[str, ...] = field(default=(), kw_only=True)

    __repr__ = short_repr

    def _in_words(self) -> str:
        times = f"{self.interval:g} s from {self.start:g} s"
        return f"of {len(self.samples)} increments of {times}, up to {self.largest:.4g} rad"

    @property
    def largest(self) -> float:
        """Largest magnitude of an element of the increments, in rad."""
        return largest_magnitude(self.samples)


@renamed(increments="samples")
@dataclass(frozen=True, repr=False)
class InertialRecording(Recording):
    """Angle and velocity increments at even intervals.

    Parameters
    ----------
    velocity_increments : array, (N, 3)
        Integrals of the specific force in m/s, body axes.

    Examples
    --------
    >>> InertialRecording(0.0, 0.01, np.full((4, 3), 1e-3), np.zeros((4, 3))).largest
    0.001
    """

    velocity_increments: Array


@dataclass(frozen=True)
class History(Records):
    """The attitude along a recording.

    Parameters
    ----------
    time : array, (N,)
        Times in s, on the clock of the recording.
    states : array, (N, state shape)
        States of the back end.
    step : float
        Step length in s.
    unused : int
        Number of increments at the end that do not fill a step.
    elements : tuple of str
        Names of the elements of a state, row-major; empty where they are not known.

    Examples
    --------
    >>> from strapgen import backend
    >>> history = propagate(backend("euler"), Recording(0.0, 0.01, np.zeros((20, 3))))
    >>> history.states.shape, history.step
    ((11, 4), 0.02)
    """

    time: Array
    states: NDArray[Any]
    step: float
    unused: int
    elements: tuple[str, ...] = ()

    __repr__ = short_repr

    def _in_words(self) -> str:
        times = f"{self.time[0]:g} s to {self.time[-1]:g} s, steps of {self.step:g} s"
        return f"of {len(self.time)} states, {times}; {self.unused} increments unused"


def read_increments(path: str | Path) -> Recording:
    r"""Read a file of angle increments.

    Parameters
    ----------
    path : path
        Comma-separated values: time in s at the end of each increment, and the increments about x, y, z in
        rad. A header, if there is one, names the columns t, dx, dy, dz, in any order.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If the file cannot be read, a value is no finite number, or the times are not even; the message names
        the line.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "gyro.csv"
    >>> _ = log.write_text("t,dx,dy,dz\n0.1,0,0,1e-3\n0.2,0,0,2e-3\n")
    >>> read_increments(log).samples[:, 2]
    array([0.001, 0.002])
    """
    start, interval, values = _even_increments(checks.path("path", path), _INCREMENT_COLUMNS)
    return Recording(start, interval, values)


def read_inertial(path: str | Path) -> InertialRecording:
    r"""Read a file of angle and velocity increments.

    Parameters
    ----------
    path : path
        Comma-separated values: time in s at the end of each increment, the angle increments about x, y, z in rad, the
        velocity increments along x, y, z in m/s. A header, if there is one, names the columns t, dx, dy, dz, dvx, dvy,
        dvz, in any order.

    Returns
    -------
    InertialRecording

    Raises
    ------
    InputError
        If the file cannot be read, a value is no finite number, or the times are not even; the message names
        the line.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "inertial.csv"
    >>> _ = log.write_text("0.1,0,0,1e-3,0,0,0.98\n0.2,0,0,2e-3,0,0,0.98\n")
    >>> read_inertial(log).velocity_increments[:, 2]
    array([0.98, 0.98])
    """
    start, interval, values = _even_increments(checks.path("path", path), _INERTIAL_COLUMNS)
    return InertialRecording(start, interval, *map(np.ascontiguousarray, np.hsplit(values, 2)))


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def read_rates(
    path: str | Path,
    unit: str | None = None,
    resample_hz: float | str | Fraction | None = None,
    *,
    columns: str | None = None,
    time_unit: str | None = None,
    sample_hz: float | str | Fraction | None = None,
    bridge_gaps: bool = False,
    drop_repeated: bool = False,
) -> Recording:
    r"""Read a file of body rates and integrate them, with linear interpolation between samples.

    Parameters
    ----------
    path : path
        A table with commas, semicolons, tabs or blanks between cells. A header names the columns of the time and of
        three rates, with their units if it states any: ``time [ms],gx [deg/s],gy [deg/s],gz [deg/s]``. Without one
        there are four columns: time in s, and the rates.
    unit : str, optional
        Unit of the rates, a key of `RATE_UNITS`, where the header has none.
    resample_hz : number, optional
        Frequency of an even grid to integrate over, needed if the times are not even.
    columns : str, optional
        Names or numbers of the columns, with commas between, where the header leaves them open: the time and three
        rates, or with `sample_hz` the rates alone.
    time_unit : str, optional
        "s", "ms", "us" or "ns", where the header has none.
    sample_hz : number, optional
        Sampling rate in Hz, in place of a column of times.
    bridge_gaps : bool, optional
        Whether the rate is linear across gaps too; it needs `resample_hz`.
    drop_repeated : bool, optional
        Whether rows are left out whose time is that of the row before.

    Returns
    -------
    Recording
        Its `remarks` say what was bridged and left out.

    Raises
    ------
    InputError
        If the file cannot be read, its columns or units are open or contradict what is stated, a value is no finite
        number, there is a gap, or the times are not even and there is no `resample_hz`; the message names the line.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "gyro.csv"
    >>> _ = log.write_text("t [s],x,y,z\n0,0,0,1\n1,0,0,3\n2,0,0,3\n")
    >>> read_rates(log, "rad/s").samples[:, 2]
    array([2., 3.])
    >>> read_rates(log, "rad/s", resample_hz=2).samples[:, 2]
    array([0.75, 1.25, 1.5 , 1.5 ])
    """
    path = checks.path("path", path)
    if unit is not None:
        unit = known_unit("rate unit", unit, units.RATES)
    if time_unit is not None:
        time_unit = known_unit("time unit", time_unit, units.TIMES)
    if bridge_gaps and resample_hz is None:
        raise InputError("bridge_gaps needs resample_hz, an even grid for the rate across a gap")
    has_time = sample_hz is None
    find = partial(rates_layout, unit=unit, columns=columns, time_unit=time_unit, has_time=has_time)
    rows, layout = read_rows(path, find, sample_hz)
    if layout.unit is None:
        raise InputError(
            f"{path} states no unit of the rates; --rate-unit is needed, {', '.join(RATE_UNITS)}"
        )
    factor = RATE_UNITS[layout.unit]
    remarks: list[str] = []
    if drop_repeated:
        rows = without_repeated(path, rows, remarks)
    time, lines = rows.time, rows.lines
    intervals, median = _checked_intervals(path, rows, bridge_gaps)
    if bridge_gaps:
        remarks += gap_remarks(rows, median)
    if resample_hz is None:
        _require_even(path, intervals, median, lines, "resample_hz integrates them over an even grid")
        interval = float((time[-1] - time[0]) / intervals.count)
        increments = integrals(rows, factor)
    else:
        interval = 1 / float(checks.number("resample_hz", resample_hz, positive=True))
        increments = resampled(rows, factor, interval, grid_points(path, time, resample_hz, interval))
    recording = Recording(float(time[0]), interval, increments, remarks=tuple(remarks))
    if not math.isfinite(recording.largest):
        raise InputError(f"{path}: the integral of a rate is beyond the range of double")
    return recording


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def propagate(
    backend: Backend,
    recording: Recording,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
    pulse: float | str | Fraction | None = None,
) -> History:
    """Run an algorithm over recorded increments, from zero rotation.

    An algorithm that takes increments from before its step starts after as many of them.

    Parameters
    ----------
    backend : Backend
        The algorithm, which also determines the number of increments per step.
    recording : Recording
    orthonormalize, record : number, optional
        Intervals in s of orthonormalization (by default there is none) and of records (by default every step), each a
        multiple of the step to a hundredth of a step.
    pulse : number, optional
        Angle of a gyro pulse in rad, see `gyro.pulses`; by default increments are not quantized.

    Returns
    -------
    History

    Raises
    ------
    InputError
        If the algorithm takes no increments, the recording is shorter than a step, a time is no multiple of
        the step, or the attitude leaves the range of the back end's numbers.

    Examples
    --------
    >>> from strapgen import backend
    >>> recording = Recording(0.0, 0.01, np.full((9, 3), 1e-3))
    >>> history = propagate(backend("euler", "rk4", 2), recording)
    >>> history.states.shape, history.unused
    ((5, 4), 1)
    """
    checks.require("propagate", backend, Backend)
    if not isinstance(recording, Recording):
        raise InputTypeError(
            f"recording is {checks.describe(recording)}; a Recording is needed "
            "(an array goes to Backend.propagate)"
        )
    backend.need_increments()
    step = recording.interval * backend.increments
    steps, unused = divmod(
        max(0, len(recording.samples) - backend.samples_per_step + backend.increments), backend.increments
    )
    if steps < 1:
        raise InputError(
            f"the recording holds {len(recording.samples)} increments; a step needs {backend.samples_per_step}"
        )
    record_every = 1 if record is None else record_interval("record", record, step)
    every = None if orthonormalize is None else record_interval("orthonormalize", orthonormalize, step)
    if record_every > steps:
        raise InputError(f"record {record} s is longer than the recording, {steps * step:.6g} s")

    def read(first: int, stop: int) -> Array:
        release(recording.samples)  # what was read of a long one before
        return recording.samples[first:stop]

    parts_of_run = StepWindows(read, backend.increments, backend.previous + backend.ahead, pulse)
    states = backend.propagate_parts(parts_of_run, steps, record_every, every)
    start = recording.start + recording.interval * backend.previous
    time: Array = start + step * record_every * np.arange(len(states), dtype=np.float64)
    require_finite(backend, states, time)
    require_proper(backend, states, time)
    return History(time, states, step, unused, backend.elements)


def _checked_intervals(
    path: Path, rows: RecordedRows, bridged: bool = False
) -> tuple[SampleIntervals, float]:
    """Return the intervals and their median in s; refuse times that do not rise, and gaps."""
    time, lines = rows.time, rows.lines
    if not math.isfinite(float(time[-1]) - float(time[0])):
        raise InputError(f"{path}: times from {time[0]:g} s to {time[-1]:g} s are too far apart")
    intervals = SampleIntervals(time)
    shortest, worst = intervals.shortest
    if shortest <= 0:
        raise InputError(
            f"{path}, line {lines[worst + 1]}: "
            f"time {float(time[worst + 1])!r} s does not come after {float(time[worst])!r} s"
            + ("; --drop-repeated leaves out rows with the same time" if shortest == 0 else "")
        )
    median = intervals.median()
    longest, widest = intervals.longest
    if longest > GAP * median and not bridged:
        raise InputError(
            f"{path}, line {lines[widest + 1]}: a gap of {longest:.6g} s; "
            f"the median interval is {median:.6g} s, and up to {GAP} times that is allowed; --bridge-gaps with "
            "--resample-hz takes the rate as linear across it"
        )
    return intervals, median


def _require_even(
    path: Path, intervals: SampleIntervals, median: float, lines: LineNumbers, remedy: str
) -> None:
    departure, worst = intervals.farthest(median)
    interval = intervals.at(worst)
    if departure > _EVEN * median:
        raise InputError(
            f"{path}, line {lines[worst + 1]}: sample times are not even: the interval of {interval:.6g} s "
            f"before it is the worst, the median is {median:.6g} s; {remedy}"
        )


def _even_increments(path: Path, columns: Mapping[str, str]) -> tuple[float, float, Array]:
    """Return the time at which the first increment begins, the interval, and the increments."""

    def find(header: Sequence[str] | None, width: int) -> ColumnLayout:
        return named_layout(header, width, [*columns], [*columns.values()])

    rows, _ = read_rows(path, find)
    intervals, median = _checked_intervals(path, rows)
    _require_even(path, intervals, median, rows.lines, "increments are needed at even times")
    interval = float((rows.time[-1] - rows.time[0]) / intervals.count)
    return float(rows.time[0]) - interval, interval, rows.values


def record_interval(what: str, value: float | str | Fraction, step: float) -> int:
    """Return the number of steps in an interval in s, to a hundredth of a step."""
    ratio = float(checks.number(what, value, positive=True)) / step
    if not 0.5 < ratio <= checks.MOST or abs(ratio - round(ratio)) > 0.01:
        raise InputError(f"{what} {value} s is not a whole multiple of the step {step:.6g} s")
    return round(ratio)


def without_repeated(path: Path, rows: RecordedRows, remarks: list[str]) -> RecordedRows:
    """Return rows without those whose time is that of the row before."""
    is_new = np.concatenate([[True], np.diff(rows.time) != 0])
    dropped = int(len(is_new) - is_new.sum())
    if not dropped:
        return rows
    first = rows.lines[int(np.argmin(is_new))]
    remarks.append(
        f"{counted(dropped, 'row')} with the time of the row before left out, the first in line {first}"
    )
    lines = LineNumbers()
    for place, row in enumerate(np.flatnonzero(is_new)):
        lines.add(place, [rows.lines[int(row)]])
    return RecordedRows(rows.time[is_new], rows.values[is_new], lines)


def gap_remarks(rows: RecordedRows, median: float) -> list[str]:
    """Return a remark for each gap that is bridged."""
    steps = np.diff(rows.time)
    return [
        f"a gap of {steps[place]:.6g} s before line {rows.lines[int(place) + 1]}, from {rows.time[place]:.6g} s on, is "
        "bridged: the rate is taken as linear across it"
        for place in np.flatnonzero(steps > GAP * median)
    ]


def grid_points(path: Path, time: Array, resample_hz: float | str | Fraction, interval: float) -> int:
    """Return the number of intervals of an even grid over a recording."""
    ratio = (float(time[-1]) - float(time[0])) / interval * (1 + 1e-12)
    if ratio > checks.MOST:
        raise InputError(f"resample_hz {resample_hz}: {path} would make over {checks.MOST:.0e} increments")
    count = math.floor(ratio)
    if count < 1:
        raise InputError(
            f"resample_hz {resample_hz}: {path} is {time[-1] - time[0]:.6g} s long, less than one interval"
        )
    return count


def integrals(rows: RecordedRows, factor: float) -> Array:
    """Return the integrals of rates from each row to the next."""
    increments = Columns(3)
    for first, part in parts(rows.values, 1):
        rates, time = part * factor, np.asarray(rows.time[first : first + len(part)])
        increments.append((rates[1:] + rates[:-1]) / 2 * np.diff(time)[:, None])
    release(rows.time)
    return increments.array()


def resampled(rows: RecordedRows, factor: float, interval: float, count: int) -> Array:
    """Return the integrals of rates over an even grid of so many intervals."""
    begin, end, last = float(rows.time[0]), float(rows.time[-1]), len(rows.time) - 1
    increments, angle, before, done = Columns(3), np.zeros((1, 3)), np.zeros((0, 3)), 0
    for first, part in parts(rows.values, 1):
        rates, time = part * factor, np.asarray(rows.time[first : first + len(part)])
        gaps = np.diff(time)
        pieces = (rates[1:] + rates[:-1]) / 2 * gaps[:, None]
        slopes = np.diff(rates, axis=0) / gaps[:, None]
        angles = np.cumsum(np.vstack([angle, pieces]), axis=0)
        angle = angles[-1:]
        while done <= count:
            grid = np.minimum(begin + interval * np.arange(done, min(done + PART, count + 1)), end)
            if first + len(gaps) < last:  # the rest lies in the parts to come
                grid = grid[grid < time[-1]]
            if not len(grid):
                break
            row = np.minimum(np.searchsorted(time, grid, side="right") - 1, len(gaps) - 1)
            inside = (grid - time[row])[:, None]
            there = angles[row] + inside * (rates[row] + inside / 2 * slopes[row])
            increments.append(np.diff(np.vstack([before, there]), axis=0))
            before, done = there[-1:], done + len(grid)
    release(rows.time)
    return increments.array()
