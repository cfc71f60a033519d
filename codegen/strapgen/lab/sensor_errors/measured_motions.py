"""Motions and recordings as sensors with errors measure them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import InertialMotion, Motion
from strapgen.lab.motions.specific_forces import velocity_increments
from strapgen.lab.recordings.recording import InertialRecording, Recording
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.sensors import MeasurementUnit, steady

Array = NDArray[np.float64]
Recorded = TypeVar("Recorded", bound=Recording)

#: Samples of a recording that are measured together.
_PART = 1 << 16


@dataclass
class _Progress:
    """The measurement unit of a run, and the number of samples that it has measured."""

    interval: Fraction
    unit: MeasurementUnit
    stop: int = 0


@dataclass(frozen=True, eq=False)
class MeasuredMotion(Motion):
    """A motion whose increments are those of sensors with errors, and whose attitude is the true one.

    The random errors begin at t = 0; increments from before have the steady errors alone.
    """

    true: Motion = field(default_factory=lambda: Motion("constant", {}))
    errors: InstrumentErrors = field(default_factory=InstrumentErrors)
    #: Number of the run, which decides on the random numbers
    run: int = 0
    #: Specific force in m/s^2, constant in reference axes
    force: tuple[float, ...] = (0.0, 0.0, 0.0)
    #: (3, 3): attitude at the start, before that of the motion; None for zero rotation
    start: Any = None
    _progress: list[_Progress] = field(default_factory=list)

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return measured angle increments, see `Motion.samples`.

        Samples are measured in their order; to go back is to measure all from the first one again.
        """
        begin = max(first, 0)
        progress = self._at(interval, begin)
        parts = []
        if first < 0:
            before = MeasurementUnit(steady(progress.unit.errors), float(interval))
            parts.append(before(*self._true(interval, first, min(stop, 0)))[0])
        if stop > begin:
            parts.append(progress.unit(*self._true(interval, begin, stop))[0])
            progress.stop = stop
        return np.concatenate(parts) if parts else np.empty((0, 3))

    def attitude(self, time: Any) -> Array:
        """Return the true attitude, see `Motion.attitude`."""
        return self.true.attitude(time)

    def rate(self, time: Any) -> Array:
        """Refuse to return a rate: sensors measure increments."""
        raise InputError("sensor errors go with increments, and the algorithm takes rates")

    def _at(self, interval: Fraction, first: int) -> _Progress:
        """Return the unit that has measured all samples before the first one."""
        if not self._progress or self._progress[0].interval != interval or self._progress[0].stop > first:
            unit = MeasurementUnit(self.errors, float(interval), self.run)
            self._progress[:] = [_Progress(interval, unit)]
        progress = self._progress[0]
        while progress.stop < first:
            stop = min(first, progress.stop + _PART)
            progress.unit(*self._true(interval, progress.stop, stop))
            progress.stop = stop
        return progress

    def _true(self, interval: Fraction, first: int, stop: int) -> tuple[Array, Array]:
        """Return true angle and velocity increments."""
        if isinstance(self.true, InertialMotion):
            return self.true.both_samples(interval, first, stop)
        begin = first * float(interval)

        def attitude(time: Array) -> Array:
            matrices = self.true.attitude(np.maximum(begin + time, 0.0))
            return matrices if self.start is None else np.asarray(self.start) @ matrices

        velocity = velocity_increments(attitude, self.force, interval, stop - first)
        return self.true.samples(interval, first, stop), velocity


def measured(
    motion: Motion,
    errors: InstrumentErrors,
    run: int = 0,
    force: tuple[float, ...] | None = None,
    start: Any = None,
) -> Motion:
    """Return a motion as sensors measure it; the motion itself if they have no errors.

    Parameters
    ----------
    motion : Motion
    errors : InstrumentErrors
    run : int, optional
        Number of the run: each has random numbers of its own.
    force : tuple of float, (3,), optional
        Specific force in m/s^2, constant in reference axes.
    start : array, (3, 3), optional
        Attitude at the start, body to reference; by default there is no rotation.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        If errors of the gyros depend on a specific force that is not stated.

    Examples
    --------
    >>> from strapgen import backend, motion, simulate
    >>> from strapgen.lab.sensor_errors.error_file import read
    >>> rest = measured(motion("constant", z_deg_s=0), read("ins-1"))
    >>> bool(simulate(backend("euler"), rest, "0.01", 10).mean_drift > 0)
    True
    """
    if not any(errors.causes):
        return motion
    if force is None and errors.needs_acceleration and not isinstance(motion, InertialMotion):
        raise InputError("the errors of the gyros depend on acceleration; a specific force is needed")
    return MeasuredMotion(
        motion.name, motion.parameters, motion, errors, run, force or (0.0, 0.0, 0.0), start
    )


def measured_recording(recording: Recorded, errors: InstrumentErrors, run: int = 0) -> Recorded:
    """Return a recording whose increments, taken as true, are those of sensors with errors.

    Parameters
    ----------
    recording : Recording
    errors : InstrumentErrors
    run : int, optional

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If errors of the gyros depend on acceleration, and the recording has none.

    Examples
    --------
    >>> from strapgen import Recording, sensors
    >>> still = Recording(0.0, 0.01, np.zeros((4, 3)))
    >>> biased = sensors.InstrumentErrors(gyro=sensors.TriadErrors(bias=np.full(3, 1e-3)))
    >>> measured_recording(still, biased).samples[0]
    array([1.e-05, 1.e-05, 1.e-05])
    """
    if not any(errors.causes):
        return recording
    inertial = isinstance(recording, InertialRecording)
    if errors.needs_acceleration and not inertial:
        raise InputError(
            "the errors of the gyros depend on acceleration, and the recording has no velocity increments"
        )
    angle = np.empty(recording.samples.shape)
    velocity = np.empty(angle.shape if inertial else (0, 3))
    unit = MeasurementUnit(errors, recording.interval, run)
    for first in range(0, len(angle), _PART):
        part = slice(first, first + _PART)
        of_part = (
            np.asarray(recording.velocity_increments[part])
            if isinstance(recording, InertialRecording)
            else None
        )
        angle[part], sensed = unit(np.asarray(recording.samples[part]), of_part)
        if inertial:
            velocity[part] = sensed
    changes: dict[str, Any] = {"samples": angle} | ({"velocity_increments": velocity} if inertial else {})
    return replace(recording, **changes)


def both_increments(
    motion: Motion, attitude: Any, force: tuple[float, ...], interval: Fraction, count: int
) -> tuple[Array, Array]:
    """Return the angle and velocity increments that a whole unit measures on a motion from t = 0 on.

    `attitude`: returns the attitude at some times in s, that at the start included. `force`: specific force in
    m/s^2, constant in reference axes. `interval`: in s. Returns (count, 3): in rad and m/s, body axes.
    """
    true = motion.true if isinstance(motion, MeasuredMotion) else motion
    if isinstance(true, InertialMotion):
        both = true.both_samples(interval, 0, count)
    else:
        both = true.samples(interval, 0, count), velocity_increments(attitude, force, interval, count)
    if not isinstance(motion, MeasuredMotion):
        return both
    return MeasurementUnit(motion.errors, float(interval), motion.run)(*both)
