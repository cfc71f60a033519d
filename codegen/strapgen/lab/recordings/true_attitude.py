"""A true attitude with its own stamps, and the error of a computed attitude beside it.

The clocks are compared by the magnitude of the rate, which depends on no frame; a frame is turned only as the caller
says.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks, units
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.ir.read_only import ReadOnly, read_only
from strapgen.lab.recordings import meanings, quaternions
from strapgen.lab.recordings.attitude_names import ALIGNMENTS, QUATERNIONS, SENSES
from strapgen.lab.recordings.attitude_output import attitude_of
from strapgen.lab.recordings.log_file import LogFile, open_log
from strapgen.lab.recordings.meanings import AttitudeColumns
from strapgen.lab.recordings.recording import History, Recording
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]

#: From this multiple of the median interval on, the attitude between two stamps is not known.
GAP = 10
#: From this interval on times in no stated unit may be in ms, us or ns, in s.
_LONG_INTERVAL = 1.5
#: An offset up to so many s is taken where its correlation is nearly as good as that of any other: one clock.
_SAME_CLOCK, _AS_GOOD = 5.0, 0.9
#: Least overlap of two records as a part of the shorter one, and least correlation that tells an offset.
_OVERLAP, _CORRELATED = 0.5, 0.5
#: Most instants that are correlated, and the least interval between them in s.
_MOST_INSTANTS, _LEAST_INTERVAL = 1 << 18, 0.01
#: Parts of a run that are left out in turn for an uncertainty (the jackknife).
_PARTS = 10
#: Least time in s of a turn that tells how two bodies are mounted, and its least angle in rad.
_TURN_SECONDS, _TURN_ANGLE = 0.5, 0.02
#: The other sense is told where turns differ by this much in rad or more, and from those of the inverse by a fourth.
_OTHER_SENSE, _CLEARLY = 0.01, 0.25
#: Seconds in an hour.
_HOUR = 3600


@dataclass(frozen=True)
class TrueAttitude(ReadOnly):
    """An attitude that a run along a recording is judged by.

    Parameters
    ----------
    time : array, (N,)
        Its own stamps in s, rising.
    quaternions : array, (N, 4)
        x, y, z, s (scalar last) of length 1, body to reference.
    remarks : tuple of str, optional
        What was left out, a sentence each.

    Examples
    --------
    >>> truth = TrueAttitude.of([0, 1, 2], [[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]], order="sxyz")
    >>> truth.quaternions.tolist(), truth.remarks
    ([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]], ('1 row without an attitude left out, the first is row 2',))
    """

    time: Array
    quaternions: Array
    remarks: tuple[str, ...] = ()

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {len(self.time)} attitudes, {self.time[0]:g} s to {self.time[-1]:g} s"

    @classmethod
    def of(
        cls, time: Any, attitudes: Any, *, order: str = "xyzs", sense: str = "body-to-reference"
    ) -> TrueAttitude:
        """Return the true attitude of stamps and quaternions or matrices.

        Parameters
        ----------
        time : array_like, (N,)
            In s.
        attitudes : array_like, (N, 4) or (N, 3, 3)
            Quaternions, or direction cosine matrices. Rows of zeros or without a number are left out, as those are that
            repeat the stamp of the row before.
        order : str, optional
            "xyzs" or "sxyz": the order of a quaternion.
        sense : str, optional
            "body-to-reference" or "reference-to-body": what each turns.

        Returns
        -------
        TrueAttitude

        Raises
        ------
        InputError
            If shapes do not fit, stamps do not rise, fewer than two attitudes are left, or a quaternion's length is not
            1 within 1 %.

        Examples
        --------
        >>> TrueAttitude.of([0, 1], [[0, 0, 0.6, 0.8]] * 2, sense="reference-to-body").quaternions[0].tolist()
        [-0.0, -0.0, -0.6, 0.8]
        """
        checks.choice("order", order, QUATERNIONS)
        checks.choice("sense", sense, SENSES)
        stamps = checks.numbers("time", time, (None,))
        values = checks.numbers("attitudes", attitudes)
        if values.shape not in ((len(stamps), 4), (len(stamps), 3, 3)):
            raise InputError(
                f"attitudes has shape {values.shape}; ({len(stamps)}, 4) or ({len(stamps)}, 3, 3) is needed"
            )
        flat = values.reshape(len(stamps), -1)
        lengths = np.linalg.norm(flat, axis=1) / math.sqrt(flat.shape[1] / 3 if values.ndim == 3 else 1)
        present = np.isfinite(lengths) & np.isfinite(stamps) & (lengths > 0)
        fresh = np.concatenate([[True], np.diff(stamps) != 0])[: len(stamps)]
        remarks = _left_out(~present, "without an attitude") + _left_out(
            present & ~fresh, "with the stamp of the row before"
        )
        kept = np.flatnonzero(present & fresh)
        if len(kept) < 2:
            raise InputError(f"the truth holds {counted(len(kept), 'attitude')}; at least 2 are needed")
        backwards = np.flatnonzero(np.diff(stamps[kept]) <= 0)
        if len(backwards):
            row = int(kept[backwards[0] + 1])
            raise InputError(f"the truth's time {stamps[row]:.9g} s in row {row + 1} does not rise")
        worst = int(kept[np.argmax(np.abs(lengths[kept] - 1))])
        if abs(lengths[worst] - 1) > 0.01:
            raise InputError(
                f"the truth's attitude in row {worst + 1} has length {lengths[worst]:.4g}; 1 is needed: are these the "
                "columns of a quaternion?"
            )
        if values.ndim == 3:
            q = quaternions.from_matrices(values[kept])
        else:
            q = values[kept] / lengths[kept, None]
            q = quaternions.continuous(q if order == "xyzs" else np.roll(q, -1, axis=1))
        return cls(
            stamps[kept], q if sense == "body-to-reference" else quaternions.inverse(q), tuple(remarks)
        )

    @classmethod
    def read(
        cls,
        path: str | Path,
        topic: str = "",
        *,
        columns: str | None = None,
        order: str | None = None,
        sense: str = "body-to-reference",
        time_unit: str | None = None,
        sample_hz: float | str | Fraction | None = None,
    ) -> TrueAttitude:
        r"""Read a true attitude from a log of any format that `read` takes.

        Parameters
        ----------
        path : path
        topic : str, optional
            Name of the table, by default the first that has an attitude.
        columns : str, optional
            Names or numbers of the columns where the log leaves them open, with commas between: the time, and a
            quaternion or roll, pitch and heading.
        order : str, optional
            "xyzs" or "sxyz": the order of the quaternion, where names do not say it.
        sense : str, optional
            "body-to-reference" or "reference-to-body": what each turns.
        time_unit : str, optional
            "s", "ms", "us" or "ns", where the log has none.
        sample_hz : number, optional
            Sampling rate in Hz, in place of a column of times.

        Returns
        -------
        TrueAttitude

        Raises
        ------
        InputError
            If the log cannot be read, its columns are open, or `of` refuses what it holds.

        Examples
        --------
        >>> import tempfile
        >>> log = Path(tempfile.mkdtemp()) / "poses.tum"
        >>> _ = log.write_text("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1 0\n")
        >>> TrueAttitude.read(log).quaternions[1].tolist()
        [0.0, 0.0, 1.0, 0.0]
        """
        log = open_log(path)
        names = [one.name for one in log.topics]
        if topic:
            checks.choice("topic", topic, names)
        for one in log.topics:
            if topic not in ("", one.name):
                continue
            try:
                layout = meanings.attitude(one, columns, order, time_unit, has_time=sample_hz is None)
            except InputError as error:
                if topic or len(names) == 1:
                    raise InputError(f"{log.path}: {error}") from None
                continue
            return _of_columns(cls, log, one.name, layout, sense, sample_hz)
        raise InputError(f"{log.path}: no topic has a time and an attitude; it has {checks.some(names)}")

    @cached_property
    def longest(self) -> float:
        """The interval in s from which on the attitude between two stamps is not known."""
        return GAP * float(np.median(np.diff(self.time)))

    def at(self, time: Array, beyond: float = 0.0) -> tuple[Array, NDArray[np.bool_]]:
        """Return quaternions at some times in s on its clock, and whether it is known there: inside, and in no gap.

        `beyond`: time in s before and after it for which its rate is taken to go on.
        """
        place = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        known = (time >= self.time[0] - beyond) & (time <= self.time[-1] + beyond)
        known &= np.diff(self.time)[place] <= self.longest
        return quaternions.interpolated(self.time, self.quaternions, time), known


def _of_columns(
    cls: type[TrueAttitude],
    log: LogFile,
    topic: str,
    layout: AttitudeColumns,
    sense: str,
    sample_hz: float | str | Fraction | None,
) -> TrueAttitude:
    """Return the true attitude of some columns of a log."""
    read = log.read(topic, [*layout.columns] if layout.time is None else [layout.time, *layout.columns])
    if layout.time is None:
        step = 1 / float(checks.number("sample_hz", sample_hz or 0, positive=True))
        time = step * np.arange(len(read[layout.columns[0]]), dtype=np.float64)
    else:
        time = read[layout.time] * float(units.TIMES[layout.time_unit or "s"])
    values = np.column_stack([np.asarray(read[name], np.float64) for name in layout.columns])
    is_open = layout.time is not None and layout.time_unit is None
    if is_open and len(time) > 1 and np.median(np.abs(np.diff(time))) >= _LONG_INTERVAL:
        raise InputError(
            f"{log.path}: the truth's time states no unit and grows by {np.median(np.diff(time)):g} from row to row; "
            "--true-time-unit s, ms, us or ns says what it is"
        )
    if not layout.order:
        if layout.unit is None and np.nanmax(np.abs(values), initial=0) > 2 * math.pi:
            raise InputError(
                f"{log.path}: the angles state no unit, and are above 2 pi; a quaternion is needed"
            )
        angles = np.radians(values) if layout.unit == "deg" else values
        values = evaluator("dcm-from-euler-angles")(angles)
    try:
        found = cls.of(time, values, order=layout.order or "xyzs", sense=sense)
    except InputError as error:
        raise InputError(f"{log.path}: {error}") from None
    return replace(found, remarks=(*log.remarks, *found.remarks))


def _left_out(rows: NDArray[np.bool_], what: str) -> list[str]:
    """Return the remark on rows that are left out; none if there are none."""
    places = np.flatnonzero(rows)
    return [
        f"{counted(len(places), 'row')} {what} left out, the first is row {places[0] + 1}" for _ in places[:1]
    ]


@dataclass(frozen=True)
class TimeOffset:
    """What the clock of the truth shows more than that of a recording."""

    seconds: float
    #: Standard deviation, from parts of the run that are left out in turn; 0 where the offset is stated
    uncertainty_s: float = 0.0
    #: Correlation of the rates' magnitudes; None where the offset is stated
    correlation: float | None = None

    __repr__ = short_repr

    def in_words(self) -> str:
        """Return the offset for a reader."""
        if self.correlation is None:
            return f"the truth's clock is ahead by {self.seconds:.6g} s, as stated"
        return (
            f"the truth's clock is ahead by {self.seconds:.6f} s +- {self.uncertainty_s:.2g} s, estimated by the "
            f"correlation of the rates' magnitudes, {self.correlation:.4f}"
        )


@np.errstate(all="ignore")
def time_offset(recording: Recording, truth: TrueAttitude) -> TimeOffset:
    """Estimate what the clock of the truth shows more than that of the recording, from the magnitude of the rate.

    The peak of the correlation is searched where at least half the shorter record overlaps; one within 5 s counts if it
    is within a tenth of the highest. Least squares refine it; the standard deviation is that of ten parts left out in
    turn.

    Parameters
    ----------
    recording : Recording
    truth : TrueAttitude

    Returns
    -------
    TimeOffset
        Its `seconds` is what `attitude_error` takes.

    Raises
    ------
    InputError
        If a record is too short, or the rates have a correlation below 0.5.

    Examples
    --------
    >>> rate = np.sin(np.arange(3000)[:, None] / (70, 50, 90))
    >>> q = quaternions.from_rotation_vectors(np.cumsum(rate[:, :1] * 0.01, axis=0) * (0, 0, 1))
    >>> truth = TrueAttitude.of(100.25 + 0.01 * np.arange(1, 3001), q)
    >>> found = time_offset(Recording(0.0, 0.01, rate[:, :1] * (0, 0, 0.01)), truth)
    >>> round(found.seconds, 6), round(found.correlation, 4)
    (100.25, 1.0)
    """
    begin, end = recording.start, recording.start + recording.interval * len(recording.samples)
    length, of_truth = end - begin, float(truth.time[-1] - truth.time[0])
    step = max(
        recording.interval,
        float(np.median(np.diff(truth.time))),
        _LEAST_INTERVAL,
        (length + of_truth) / _MOST_INSTANTS,
    )
    angles = _Angles(recording)
    at: Array = begin + step * np.arange(1 + int(length / step * (1 + 1e-12)), dtype=np.float64)
    rate = angles.rates(at)
    true, known = _true_rates(truth, truth.time[0] + step * np.arange(1 + int(of_truth / step)))
    if min(len(rate), len(true)) < 2 * _PARTS:
        raise InputError(
            f"the records are too short for a time offset: {length:.3g} s, and {of_truth:.3g} s of the truth; "
            "--time-offset states it"
        )
    correlation = _correlations(rate, true, known)
    lags = np.arange(1 - len(rate), len(true))
    # The truth's instant with the number k + lag is that of the recording's k.
    offsets = truth.time[0] - begin + step * lags
    near = np.where(np.abs(offsets) <= _SAME_CLOCK, correlation, -1)
    peak, nearby = int(np.argmax(correlation)), int(np.argmax(near))
    if near[nearby] >= _AS_GOOD * correlation[peak]:
        peak = nearby
    if not correlation[peak] >= _CORRELATED:
        raise InputError(
            f"the rates of the recording and of the truth have a correlation of {max(0.0, correlation[peak]):.2f}, too "
            "little for a time offset; --time-offset S states it, 0 for one clock"
        )
    return _refined(angles, truth, step, float(offsets[peak]))


class _Angles:
    """The integrals of the rates of a recording."""

    def __init__(self, recording: Recording) -> None:
        self._angle = np.zeros((len(recording.samples) + 1, 3))
        np.cumsum(recording.samples, axis=0, out=self._angle[1:])
        self._begin, self._interval = recording.start, recording.interval

    def rates(self, at: Array) -> Array:
        """Return the magnitudes of the mean rates in rad/s between instants in s; nan outside the recording."""
        samples = (at - self._begin) / self._interval
        last = len(self._angle) - 1
        place = np.clip(samples.astype(int), 0, last - 1)
        there = self._angle[place] + (samples - place)[:, None] * (
            self._angle[place + 1] - self._angle[place]
        )
        there[(samples < -1e-9) | (samples > last + 1e-6)] = np.nan
        rates: Array = np.linalg.norm(np.diff(there, axis=0), axis=1) / np.diff(at)
        return rates


def _true_rates(truth: TrueAttitude, at: Array) -> tuple[Array, Array]:
    """Return the magnitudes of the truth's rates between instants of its clock, and 1 where both are known, else 0."""
    q, known = truth.at(at)
    turns = quaternions.rotation_vectors(quaternions.product(quaternions.inverse(q[:-1]), q[1:]))
    steps = np.diff(at) if len(at) > 1 else np.ones(0)
    return np.linalg.norm(turns, axis=1) / steps, (known[1:] & known[:-1]).astype(float)


def _correlations(rate: Array, true: Array, known: Array) -> Array:
    """Return the correlation coefficients at all lags of `true` behind `rate`, from 1 - len(rate) on; -1 for few pairs.

    D. Padfield, "Masked object registration in the Fourier domain", IEEE Trans. Image Processing 21 (2012).
    """
    size = 1 << (len(rate) + len(true) - 1).bit_length()
    rate, true = rate - rate.mean(), np.where(known > 0, true - true[known > 0].mean(), 0)

    def sums(a: Array, b: Array) -> Array:
        both = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
        return np.concatenate([both[size - len(rate) + 1 :], both[: len(true)]])

    ones = np.ones(len(rate))
    pairs = np.maximum(sums(ones, known), 1)
    a, b = sums(rate, known), sums(ones, true)
    spread = (sums(rate**2, known) - a * a / pairs) * (sums(ones, true**2) - b * b / pairs)
    found = (sums(rate, true) - a * b / pairs) / np.sqrt(np.maximum(spread, 0))
    enough = pairs >= _OVERLAP * min(len(rate), known.sum())
    return np.where(enough & np.isfinite(found), found, -1)


def _refined(angles: _Angles, truth: TrueAttitude, step: float, offset: float) -> TimeOffset:
    """Return the offset by least squares of the rates' difference, from a first one that is right to a step.

    The truth, whose noise is the larger, stays at its own stamps, and the recording is interpolated: noise that is
    interpolated is less between stamps than at them, and would draw the offset there.
    """
    at = truth.time[:: max(1, math.ceil(step / float(np.median(np.diff(truth.time))) - 1e-6))]
    true, known = _true_rates(truth, at)
    parts = np.arange(len(true)) * _PARTS // max(1, len(true))
    uncertainty = coefficient = math.nan
    for _ in range(8):
        rate, later, earlier = (angles.rates(at - offset + shift) for shift in (0, step / 4, -step / 4))
        rows = (known > 0) & np.isfinite(rate + later + earlier)
        if rows.sum() < 2 * _PARTS:
            break
        slope = (later - earlier) / (step / 2)
        change, *others = (
            _shift(rate - true, slope, part) for part in (rows, *(rows & (parts != k) for k in range(_PARTS)))
        )
        offset += change
        spread = [one - change for one in others if math.isfinite(one)]
        uncertainty = math.sqrt((_PARTS - 1) / _PARTS * sum(x * x for x in spread))
        coefficient = float(np.corrcoef(rate[rows], true[rows])[0, 1])
        if abs(change) < uncertainty / 20:
            break
    if not math.isfinite(offset + uncertainty):
        raise InputError("the truth is not known where the recording is; --time-offset S states the offset")
    return TimeOffset(offset, uncertainty, coefficient)


def _shift(difference: Array, slope: Array, rows: NDArray[np.bool_]) -> float:
    """Return the shift in s that makes a difference least but for a constant."""
    d, s = difference[rows] - difference[rows].mean(), slope[rows] - slope[rows].mean()
    return float((s @ d) / (s @ s))


@dataclass(frozen=True)
class Slope(ReadOnly):
    """A straight line through values over time."""

    #: (K,) or a number: in deg/h
    deg_h: Array
    #: Its standard deviation, from the slopes between the means of ten parts of the run: that of an error that walks,
    #: and more than that of one that is white
    uncertainty_deg_h: Array

    @staticmethod
    def of(time: Array, values: Array) -> Slope:
        """Return the slope by least squares, values (N, ...) in rad."""
        t = time - time.mean()
        slope = np.tensordot(t, values, (0, 0)) / (t @ t)
        parts = np.array_split(np.arange(len(time)), min(_PARTS, len(time)))
        means = np.array([values[part].mean(axis=0) for part in parts])
        between = np.diff(np.array([time[part].mean() for part in parts]))
        slopes = np.diff(means, axis=0) / between.reshape(-1, *[1] * (values.ndim - 1))
        missing = np.full(slope.shape, np.nan)
        spread = slopes.std(axis=0, ddof=1) / math.sqrt(len(slopes)) if len(slopes) > 1 else missing
        return Slope(np.degrees(slope) * _HOUR, np.degrees(spread) * _HOUR)


@dataclass(frozen=True)
class AttitudeError(Records):
    """The error of a computed attitude beside the truth.

    Parameters
    ----------
    time : array, (N,)
        Instants in s, on the clock of the recording: those of the slower of both records.
    vector : array, (N, 3)
        Rotation vectors in rad, reference axes, that turn the true attitude into the computed one.
    offset : TimeOffset
        What the clock of the truth shows more.
    align : str
        A key of `ALIGNMENTS`.
    reference, body : array, (4,)
        Quaternions of the turns of the computed attitude's reference and body axes.
    doubt : str, optional
        What makes the truth's stated sense doubtful.

    Examples
    --------
    >>> from strapgen import backend, propagate
    >>> turning = propagate(backend("euler"), Recording(0.0, 0.01, np.full((2000, 3), (0, 0, 1e-6))))
    >>> error = attitude_error(turning, TrueAttitude.of([0, 20], [[0, 0, 0, 1]] * 2))
    >>> error.slope.deg_h.round(3) + 0.0  # 1e-4 rad/s about z
    array([ 0.   ,  0.   , 20.626])
    """

    time: Array
    vector: Array
    offset: TimeOffset
    align: str
    reference: Array = field(repr=False)
    body: Array = field(repr=False)
    doubt: str = ""

    __repr__ = short_repr

    @cached_property
    def angle(self) -> Array:
        """The error angle in rad, (N,)."""
        angle: Array = read_only(np.linalg.norm(self.vector, axis=1))
        return angle

    @cached_property
    def slope(self) -> Slope:
        """The slope of the error about each reference axis."""
        return Slope.of(self.time, self.vector)

    @cached_property
    def angle_slope(self) -> Slope:
        """The slope of the error angle."""
        return Slope.of(self.time, self.angle)

    def _in_words(self) -> str:
        angle, axes = np.degrees(self.angle), " ".join(f"{value:.4g}" for value in self.slope.deg_h)
        return (
            f"of {len(angle)} instants, largest {angle.max():.4g} deg, at the end {angle[-1]:.4g} deg\n"
            f"slope {self.angle_slope.deg_h:.4g} deg/h, about x, y, z {axes} deg/h"
        )

    def lines(self) -> list[str]:
        """Return the error for a reader, a line for each of its parts."""
        angle = np.degrees(self.angle)
        slope, axes = self.angle_slope, self.slope
        by_axis = ", ".join(
            f"{axis} {value:.4g} +- {spread:.2g}"
            for axis, value, spread in zip("xyz", axes.deg_h, axes.uncertainty_deg_h, strict=True)
        )
        turned = {
            name: " ".join(f"{x:.4g}" for x in np.degrees(quaternions.rotation_vectors(q)))
            for name, q in (("reference", self.reference), ("body", self.body))
            if abs(q[3]) < 1
        }
        turns = "".join(f"; {name} axes by [{vector}] deg" for name, vector in turned.items())
        begun = "the run begins at the true attitude" if self.align == "start" and not turned else ""
        return [
            self.offset.in_words(),
            f"frames: {begun or ALIGNMENTS[self.align]}{turns}",
            f"error angle: rms {math.sqrt(np.mean(angle**2)):.4g} deg, largest {angle.max():.4g} deg, at the end "
            f"{angle[-1]:.4g} deg, at {len(angle)} instants over {self.time[-1] - self.time[0]:.6g} s",
            f"slope of the angle {slope.deg_h:.4g} +- {slope.uncertainty_deg_h:.2g} deg/h; of the error about the "
            f"reference axes {by_axis} deg/h (least squares; standard deviations from the slopes between ten "
            "parts)",
            *([self.doubt] if self.doubt else []),
        ]

    def at(self, time: Array) -> Array:
        """Return the error vectors (N, 3) at other times in s, linear between instants; nan where it is not known."""
        place = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, max(0, len(self.time) - 2))
        steps = np.diff(self.time)
        known = (time >= self.time[0]) & (time <= self.time[-1])
        if len(steps):
            known &= steps[place] <= GAP * np.median(steps)
        vector = np.column_stack([np.interp(time, self.time, part) for part in self.vector.T])
        return np.where(known[:, None], vector, np.nan)


def attitude_error(
    history: History, truth: TrueAttitude, offset: TimeOffset | float = 0.0, align: str = "start"
) -> AttitudeError:
    """Return the error of the attitude along a recording beside the truth.

    The attitude with the shorter intervals is interpolated at the instants of the other, at a constant rate between
    neighbours; instants in gaps of the truth are left out.

    Parameters
    ----------
    history : History
        From `propagate`.
    truth : TrueAttitude
    offset : TimeOffset or float, optional
        What the truth's clock shows more, in s; `time_offset` estimates it.
    align : str, optional
        "start", "none", "mean" or "mounting": which axes of the computed attitude are turned, see `ALIGNMENTS`.

    Returns
    -------
    AttitudeError

    Raises
    ------
    InputError
        If the states are no attitudes, the records do not overlap, or the mounting is asked for of a body that turns
        about one axis alone.

    Examples
    --------
    >>> from strapgen import backend, propagate
    >>> rest = propagate(backend("dcm"), Recording(0.0, 0.01, np.zeros((200, 3))))
    >>> error = attitude_error(rest, TrueAttitude.of([0, 2], [[0, 0, 0.6, 0.8]] * 2), align="none")
    >>> round(float(error.angle[-1]), 6)
    1.287002
    """
    checks.choice("align", align, ALIGNMENTS)
    if not isinstance(offset, TimeOffset):
        offset = TimeOffset(float(checks.number("time offset", offset)))
    # A run as a truth of its own, on the truth's clock: it is not known in gaps either.
    run = TrueAttitude(history.time + offset.seconds, attitude_of(history))
    shown, computed = run.time, run.quaternions
    found, inside = run.at(truth.time) if len(shown) > 1 else (computed, np.zeros(len(truth.time), bool))
    if len(shown) > 1 and np.median(np.diff(shown)) < np.median(np.diff(truth.time)) and inside.sum() > 1:
        at, true, found = truth.time[inside], truth.quaternions[inside], found[inside]
    else:
        true, known = truth.at(shown)
        at, true, found = shown[known], true[known], computed[known]
    if len(at) < 2:
        raise InputError(
            f"the truth is from {truth.time[0]:.12g} s to {truth.time[-1]:.12g} s, and the attitude from "
            f"{shown[0]:.12g} s to {shown[-1]:.12g} s on its clock; they have to overlap"
        )
    doubt = _doubt_of_sense(at, found, true)
    body = _mounting(at, found, true) if align == "mounting" else np.array([0.0, 0, 0, 1])
    found = quaternions.product(found, body)
    turns = quaternions.product(true, quaternions.inverse(found))
    reference = _REFERENCES[align](turns)
    vector = quaternions.rotation_vectors(
        quaternions.inverse(quaternions.product(turns, quaternions.inverse(reference)))
    )
    return AttitudeError(at - offset.seconds, vector, offset, align, reference, body, doubt)


def _mean(turns: Array) -> Array:
    """Return the rotation nearest to all (F. L. Markley and others, J. Guidance 30, 2007, page 1193)."""
    main: Array = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    return main if main[3] >= 0 else -main


#: Turn of the reference axes from the turns of all instants, by alignment.
_REFERENCES: dict[str, Callable[[Array], Array]] = {
    "start": lambda turns: turns[0],
    "none": lambda turns: np.array([0.0, 0, 0, 1]),
    "mean": _mean,
    "mounting": _mean,
}


def _turns(time: Array, q: Array) -> Array:
    """Return the rotation vectors over half a second or more, body axes."""
    apart = max(1, math.ceil(_TURN_SECONDS / float(np.median(np.diff(time)))))
    return quaternions.rotation_vectors(quaternions.product(quaternions.inverse(q[:-apart]), q[apart:]))


def _doubt_of_sense(time: Array, found: Array, true: Array) -> str:
    """Return what tells that a truth has the other sense: the turns are those of its inverse; "" if they are not."""
    mine, stated, other = (_turns(time, q) for q in (found, true, quaternions.inverse(true)))
    if not len(mine):
        return ""
    beside, better = (float(np.sqrt(np.mean(np.sum((mine - one) ** 2, axis=1)))) for one in (stated, other))
    if beside < _OTHER_SENSE or better > _CLEARLY * beside:
        return ""
    return (
        f"the truth seems to have the other sense: turns over {_TURN_SECONDS:g} s differ by "
        f"{math.degrees(beside):.2g} deg, and by {math.degrees(better):.2g} deg from those of its inverse; "
        "--true-sense states it"
    )


def _mounting(time: Array, found: Array, true: Array) -> Array:
    """Return the turn from the computed body axes to the true ones, from rotations over half a second or more."""
    mine, others = (_turns(time, q) for q in (found, true))
    moved = (np.linalg.norm(mine, axis=1) > _TURN_ANGLE) & (np.linalg.norm(mine, axis=1) < 3)
    sums = mine[moved].T @ others[moved]
    sizes = np.linalg.svd(mine[moved], compute_uv=False) if moved.any() else np.zeros(3)
    if sizes[1] < 0.05 * sizes[0] or not sizes[0]:
        raise InputError(
            "align mounting needs turns about two axes or more; the body turns about one at most"
        )
    mounting: Array = quaternions.from_matrices(quaternions.nearest(sums)[None])[0]
    return mounting
