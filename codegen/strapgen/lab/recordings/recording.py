"""Recorded gyro data from files, arrays and data frames, and an algorithm run along it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.renamed import renamed, warn
from strapgen.lab.recordings.array_log import ArrayLog, frame_log
from strapgen.lab.recordings.log_file import LogFile, open_log
from strapgen.lab.recordings.long_columns import largest_magnitude, release
from strapgen.lab.recordings.reading import Reading, increments
from strapgen.lab.runs import initial_state, require_finite, require_proper
from strapgen.run.backends import Backend
from strapgen.run.increments import StepWindows

Array = NDArray[np.float64]


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
        How the increments follow from the file, what was left out of it, and what was taken in place of what it lacks,
        a sentence each.
    breaks : tuple, optional
        Where there are gaps that nothing bridges: the number of the first increment of each piece after the first one,
        and the time in s at which it begins.

    Examples
    --------
    >>> Recording(0.0, 0.01, np.full((4, 3), 1e-3)).largest
    0.001
    """

    start: float
    interval: float
    samples: Array
    remarks: tuple[str, ...] = field(default=(), kw_only=True)
    breaks: tuple[tuple[int, float], ...] = field(default=(), kw_only=True)

    __repr__ = short_repr

    @property
    def pieces(self) -> list[Recording]:
        """The pieces between gaps, each a recording; one where there are none."""
        begins = [(0, self.start), *self.breaks]
        ends = [place for place, _ in self.breaks] + [len(self.samples)]
        velocity = getattr(self, "velocity_increments", None)
        return [
            Recording(start, self.interval, self.samples[first:last])
            if velocity is None
            else InertialRecording(start, self.interval, self.samples[first:last], velocity[first:last])
            for (first, start), last in zip(begins, ends, strict=True)
        ]

    @classmethod
    def from_rates(
        cls,
        time: Any,
        rates: Any,
        unit: str = "rad/s",
        input: str = "rates",
        force: Any = None,
        force_unit: str = "m/s^2",
        **options: Any,
    ) -> Recording:
        """Return the recording of rates in arrays.

        Parameters
        ----------
        time : array_like, (N,)
            Times in s, or stamps of NumPy's type datetime64; ``time_unit`` states another unit.
        rates : array_like, (N, 3)
            Body rates about x, y, z.
        unit : str, optional
            "rad/s", "deg/s", "mdeg/s", "mrad/s" or "deg/h".
        input : str, optional
            "rates", means over the intervals that end at the times: N give N increments; or "instants", rates at the
            times: N give N - 1 increments by the trapezoid. The remarks say which.
        force : array_like, (N, 3), optional
            Specific forces along x, y, z; with them the recording is an `InertialRecording`.
        force_unit : str, optional
            "m/s^2", "g" or "mg".
        **options
            What `read` takes of the time and of faults: ``time_unit``, ``gaps``, ``repair``, ``axes``, ``start``,
            ``end``, ``every`` and ``grid``.

        Returns
        -------
        Recording

        Raises
        ------
        InputError
            If shapes do not match, or there is a fault that is not repaired; the message names the row.

        Examples
        --------
        >>> turn = Recording.from_rates([0.0, 0.1, 0.2], np.full((3, 3), (0, 0, 90)), "deg/s", "instants")
        >>> turn.samples[:, 2].round(6).tolist()
        [0.15708, 0.15708]
        """
        reading = Reading.of(
            options, input=input, rate_unit=unit, force_unit=force_unit, force=force is not None
        )
        return recording_of(ArrayLog.of(time, rate=rates, force=force), "", reading)

    @classmethod
    def from_increments(cls, time: Any, angle: Any, velocity: Any = None, **options: Any) -> Recording:
        """Return the recording of increments in arrays.

        Parameters
        ----------
        time : array_like, (N,)
            Times in s at the ends of the increments, or stamps of NumPy's type datetime64.
        angle : array_like, (N, 3)
            Angle increments in rad, body axes.
        velocity : array_like, (N, 3), optional
            Velocity increments in m/s, body axes; with them the recording is an `InertialRecording`.
        **options
            As for `from_rates`.

        Returns
        -------
        Recording

        Raises
        ------
        InputError
            As `from_rates` does.

        Examples
        --------
        >>> Recording.from_increments([0.1, 0.2], np.full((2, 3), 1e-3)).start
        0.0
        """
        reading = Reading.of(options, input="increments", force=velocity is not None)
        return recording_of(ArrayLog.of(time, delta_angle=angle, delta_velocity=velocity), "", reading)

    @classmethod
    def from_frame(cls, frame: Any, columns: str | None = None, **options: Any) -> Recording:
        """Return the recording in a data frame of pandas, polars, xarray, pyarrow, or a mapping of arrays.

        Parameters
        ----------
        frame : data frame
            Its columns are understood as those of a file; an index with a name, or of times, is a column too.
        columns : str, optional
            Names of the columns where they leave the meaning open, as for `read`.
        **options
            As for `read`.

        Returns
        -------
        Recording

        Raises
        ------
        InputError
            As `read` does.

        Examples
        --------
        >>> frame = {"t [s]": [0.1, 0.2], "gx [deg/s]": [0, 0], "gy": [0, 0], "gz": [90, 90]}
        >>> Recording.from_frame(frame).samples[:, 2]
        array([0.15707963, 0.15707963])
        """
        return recording_of(frame_log(frame), "", Reading.of(options, columns=columns))

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
class Taken:
    """What a run along one piece of a recording took."""

    recording: Recording
    pulse: float | str | Fraction | None = None  # rad
    orthonormalize_every: int = 0  # steps; 0 for never


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
    backend : Backend, optional
        The back end whose states they are; None where the states are no attitudes.
    piece : array, (N,), optional
        Number of the piece of the recording, from 1 on; None where it has no gaps.
    taken : Taken, optional
        The recording, and what else the run took; None where it has gaps, or another unit ran.

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
    backend: Backend | None = field(default=None, repr=False, compare=False)
    piece: NDArray[Any] | None = None
    taken: Taken | None = field(default=None, repr=False, compare=False)

    __repr__ = short_repr

    def matrices(self) -> Array:
        """Return the direction cosine matrices of the states, body to reference, (N, 3, 3)."""
        if self.backend is None:
            raise InputError("the states are not known as attitudes of a back end")
        return self.backend.matrices(self.states)

    def to_frame(
        self, attitude: str = "quaternion", quaternion: str = "xyzs", sense: str = "body-to-reference"
    ) -> Any:
        """Return the attitude as a data frame of pandas, polars or pyarrow, the first that is installed.

        Parameters
        ----------
        attitude : str, optional
            "state", "rpy" for roll, pitch and heading in deg, "quaternion", "matrix", or "rotation-vector" in rad.
        quaternion : str, optional
            "xyzs" or "sxyz": the order of a quaternion.
        sense : str, optional
            "body-to-reference" or "reference-to-body": what a quaternion, matrix or rotation vector turns.

        Returns
        -------
        data frame
            A column of the time in s, and the attitude's elements.

        Raises
        ------
        InputError
            If a name is not known, or the states are no attitudes.
        MissingExtraError
            If no library of data frames is installed.

        Examples
        --------
        >>> from strapgen import backend
        >>> history = propagate(backend("dcm"), Recording(0.0, 0.5, np.full((4, 3), (0, 0, 0.1))))
        >>> [*history.to_frame("rpy")]
        ['time_s', 'roll_deg', 'pitch_deg', 'heading_deg']
        """
        from strapgen.lab.recordings.attitude_output import AttitudeForm, frame

        return frame({"time_s": self.time, **AttitudeForm(attitude, quaternion, sense).columns(self)})

    def _in_words(self) -> str:
        times = f"{self.time[0]:g} s to {self.time[-1]:g} s, steps of {self.step:g} s"
        return f"of {len(self.time)} states, {times}; {self.unused} increments unused"


def read(
    path: str | Path,
    topic: str = "",
    *,
    input: str | None = None,
    columns: str | None = None,
    time_unit: str | None = None,
    rate_unit: str | None = None,
    force_unit: str | None = None,
    sample_hz: float | str | Fraction | None = None,
    axes: str | None = None,
    start: float | str | Fraction | None = None,
    end: float | str | Fraction | None = None,
    every: int = 1,
    gaps: str = "refuse",
    repair: str | Sequence[str] = (),
    force: bool = False,
    grid: bool = False,
) -> Recording:
    r"""Read a recording from a log of any format that `strapgen log` shows.

    Parameters
    ----------
    path : path
        A table of text, or a log of an autopilot, of ROS or of a program; see the documentation for the formats.
    topic : str, optional
        Name of the table, by default the one that has rates.
    input : str, optional
        "increments" in rad; "rates", means over the intervals that end at the times; or "instants", rates at the times,
        which are integrated by the trapezoid. By default what the columns are named: increments or rates.
    columns : str, optional
        Names or numbers of the columns where the log leaves them open, with commas between: the time and three rates or
        increments, perhaps three specific forces or velocity increments too; or "t=NAME,x=NAME,y=NAME,z=NAME" with
        ``fx``, ``fy`` and ``fz``. With `sample_hz` the time is left out.
    time_unit, rate_unit, force_unit : str, optional
        Units where the log has none: "s", "ms", "us", "ns"; "rad/s", "deg/s", "mdeg/s", "mrad/s", "deg/h"; "m/s^2",
        "g", "mg".
    sample_hz : number, optional
        Sampling rate in Hz, in place of a column of times.
    axes : str, optional
        The sensor's axes that are the body's x, y and z, as "x,-y,-z".
    start, end : number, optional
        Times in s after the first row, between which rows are read.
    every : int, optional
        Number of samples that are summed into one increment.
    gaps : str, optional
        What is done where samples are lost: "refuse"; "split", so that the recording has pieces, in each of which the
        attitude starts anew; or "bridge": a single sample is restored by a filter of eight on each side, several are
        put on the line between the samples on both sides.
    repair : str or sequence of str, optional
        Faults that are repaired, "all" or some of: "repeats", rows with the time of the row before, which are left out;
        "order", rows out of order, which are sorted; "clock", times that jump back or are uneven by over a tenth of an
        interval, which are taken as even; "nan" and "stuck", rows without a number and 16 or more equal rows, which are
        restored as lost samples are.
    force : bool, optional
        Whether specific forces, or velocity increments, are read too.
    grid : bool, optional
        Whether the times are the instants of the samples, which are taken from there to an even grid by `StampedGrid`;
        by default they count as even.

    Returns
    -------
    Recording
        An `InertialRecording` with `force`. Its remarks say what was taken for what, and each fault once.

    Raises
    ------
    InputError
        If the log cannot be read, what it holds is open or contradicts what is stated, or there is a fault that is not
        repaired; the message names the place.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "gyro.csv"
    >>> _ = log.write_text("t [ms],gx [deg/s],gy,gz\n0,0,0,90\n10,0,0,90\n20,0,0,90\n40,0,0,90\n")
    >>> read(log, gaps="bridge").samples[:, 2].round(6)
    array([0.015708, 0.015708, 0.015708, 0.015708, 0.015708])
    """
    reading = Reading(
        *(input, columns, time_unit, rate_unit, force_unit, sample_hz, axes, start, end),
        *(checks.count("every", every), gaps, repair, force),
        grid=grid,
    )
    return recorded(path, topic, reading)


def recorded(path: str | Path, topic: str, reading: Reading) -> Recording:
    """Return what a file holds, read in a way."""
    return recording_of(open_log(path), topic, reading)


def read_rates(
    path: str | Path,
    unit: str | None = None,
    resample_hz: float | str | Fraction | None = None,
    *,
    columns: str | None = None,
    time_unit: str | None = None,
    sample_hz: float | str | Fraction | None = None,
) -> Recording:
    r"""Read rates at instants from a log: `read` with ``input="instants"``.

    Parameters
    ----------
    path : path
        As for `read`.
    unit : str, optional
        Unit of the rates where the log has none, as `rate_unit` of `read`.
    resample_hz : number, optional
        Old: the recording has the nearest whole number of samples in an increment, which ``every`` of `read` states.
    columns, time_unit, sample_hz : optional
        As for `read`.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        As `read` does.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "gyro.csv"
    >>> _ = log.write_text("t [s],x,y,z\n0,0,0,1\n1,0,0,3\n2,0,0,3\n")
    >>> read_rates(log, "rad/s").samples[:, 2]
    array([2., 3.])
    """
    if resample_hz is not None:
        warn("resample_hz of read_rates", "every of read, a whole number of samples")
    reading = Reading(*("instants", columns, time_unit, unit), sample_hz=sample_hz, near_hz=resample_hz)
    return recorded(path, "", reading)


def read_increments(path: str | Path) -> Recording:
    r"""Read angle increments from a log: `read` with ``input="increments"``.

    Parameters
    ----------
    path : path
        As for `read`.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        As `read` does.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "gyro.csv"
    >>> _ = log.write_text("t,dx,dy,dz\n0.1,0,0,1e-3\n0.2,0,0,2e-3\n")
    >>> read_increments(log).samples[:, 2]
    array([0.001, 0.002])
    """
    return recorded(path, "", Reading("increments"))


def read_inertial(path: str | Path) -> InertialRecording:
    r"""Read angle and velocity increments from a log: `read` with ``input="increments"`` and ``force=True``.

    Parameters
    ----------
    path : path
        As for `read`.

    Returns
    -------
    InertialRecording

    Raises
    ------
    InputError
        As `read` does.

    Examples
    --------
    >>> import tempfile
    >>> log = Path(tempfile.mkdtemp()) / "inertial.csv"
    >>> _ = log.write_text("0.1,0,0,1e-3,0,0,0.98\n0.2,0,0,2e-3,0,0,0.98\n")
    >>> read_inertial(log).velocity_increments[:, 2]
    array([0.98, 0.98])
    """
    recording = recorded(path, "", Reading("increments", force=True))
    assert isinstance(recording, InertialRecording), "forces are read"
    return recording


def recording_of(log: LogFile, topic: str, reading: Reading) -> Recording:
    """Return what a log holds."""
    start, interval, angle, velocity, remarks, breaks = increments(log, topic, reading)
    if velocity is None:
        return Recording(start, interval, angle, remarks=remarks, breaks=breaks)
    return InertialRecording(start, interval, angle, velocity, remarks=remarks, breaks=breaks)


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def propagate(
    backend: Backend,
    recording: Recording,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
    pulse: float | str | Fraction | None = None,
    initial: Any = None,
) -> History:
    """Run an algorithm over recorded increments.

    An algorithm that takes increments from before its step starts after as many of them. Each piece of a recording with
    gaps starts anew; pieces that are shorter than a step are left out.

    Parameters
    ----------
    backend : Backend
        The algorithm, which also determines the number of increments per step.
    recording : Recording
    orthonormalize, record : number, optional
        Intervals in s of orthonormalization (by default there is none) and of records (by default every step), each a
        multiple of the step to a hundredth.
    pulse : number, optional
        Angle of a gyro pulse in rad, see `gyro.pulses`; by default increments are not quantized.
    initial : array_like, (3, 3), or Rotation, optional
        Direction cosine matrix at the start of each piece, body to reference, or SciPy's rotation; by default there is
        no rotation.

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
    if hasattr(initial, "as_matrix"):  # a Rotation of SciPy
        initial = initial.as_matrix()
    begin = None if initial is None else initial_state(backend, initial)
    return along_pieces(
        recording,
        lambda piece: _along(backend, piece, orthonormalize, record, pulse, begin),
        backend.samples_per_step,
    )


def along_pieces(recording: Recording, run: Callable[[Any], History], least: int = 1) -> History:
    """Return the history of all pieces of a recording, which run one by one.

    `least`: increments of a step; shorter pieces are left out.
    """
    if not recording.breaks:
        return run(recording)
    pieces = recording.pieces
    long = [piece for piece in pieces if len(piece.samples) >= least] or pieces[:1]
    histories = [run(piece) for piece in long]
    short = sum(len(piece.samples) for piece in pieces) - sum(len(piece.samples) for piece in long)
    return replace(
        histories[0],
        time=np.concatenate([one.time for one in histories]),
        states=np.concatenate([one.states for one in histories]),
        unused=short + sum(one.unused for one in histories),
        piece=np.repeat(np.arange(1, 1 + len(histories)), [len(one.time) for one in histories]),
        taken=None,
    )


def _along(
    backend: Backend,
    recording: Recording,
    orthonormalize: float | str | Fraction | None,
    record: float | str | Fraction | None,
    pulse: float | str | Fraction | None,
    begin: Any,
) -> History:
    """Run an algorithm over one piece of a recording from a state."""
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
    states = backend.propagate_parts(parts_of_run, steps, record_every, every, begin)
    start = recording.start + recording.interval * backend.previous
    time: Array = start + step * record_every * np.arange(len(states), dtype=np.float64)
    require_finite(backend, states, time)
    require_proper(backend, states, time)
    taken = Taken(recording, pulse, every or 0)
    return History(time, states, step, unused, backend.elements, backend, taken=taken)


def record_interval(what: str, value: float | str | Fraction, step: float) -> int:
    """Return the number of steps in an interval in s, which is a multiple of the step to a hundredth."""
    ratio = float(checks.number(what, value, positive=True)) / step
    if not 0.5 < ratio <= checks.MOST or abs(ratio - round(ratio)) > 0.01 * max(1, ratio):
        raise InputError(f"{what} {value} s is not a whole multiple of the step {step:.6g} s")
    return round(ratio)
