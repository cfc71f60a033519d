"""The bias of a gyro at rest, and the Earth's rate in it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.lab.recordings import quaternions
from strapgen.lab.recordings.recording import History, Recording

Array = NDArray[np.float64]

#: The Earth's rate in rad/s (WGS 84).
EARTH_RATE_RAD_S = 7.292115e-5
#: The Earth's rate in level axes from sine and cosine of the latitude, as parts of its magnitude.
_LEVEL: dict[str, Callable[[float, float], tuple[float, float, float]]] = {
    "ned": lambda sine, cosine: (cosine, 0.0, -sine),
    "enu": lambda sine, cosine: (0.0, cosine, sine),
}
#: Seconds of a window, and windows in a row that are a rest.
_WINDOW_SECONDS, _LEAST_WINDOWS = 0.5, 4
#: Samples of a window at least.
_LEAST_SAMPLES = 8
#: A rest is where the deviation of a window is within this multiple of the calmest one, and in rad/s at most.
_CALM, _MOST_DEVIATION = 3.0, math.radians(1.0)
#: Largest mean rate of a rest, and largest difference of the means of its windows from it, in rad/s.
_MOST_RATE, _MOST_CHANGE = math.radians(5.0), math.radians(0.5)
#: Windows that are worked on together.
_TOGETHER = 1 << 11
#: Parts of a rest whose means tell the uncertainty of its mean.
_PARTS = 32


@dataclass(frozen=True)
class Rest:
    """The mean rate of a gyro in an interval without motion.

    Parameters
    ----------
    start_s, end_s : float
        Its ends in s, on the clock of the recording.
    rate : array, (3,)
        Mean rate in rad/s, body axes: bias, and the Earth's rate.
    uncertainty : array, (3,)
        Standard deviation of the mean in rad/s, from the means of 32 parts.
    noise : array, (3,)
        Angle random walk in rad/sqrt(s), from the same means.

    Examples
    --------
    >>> from strapgen import Recording
    >>> noise = np.random.default_rng(1).normal(0, 1e-5, (2000, 3))
    >>> rest = rests(Recording(0.0, 0.01, noise + 2e-5))[0]
    >>> rest.end_s, rest.rate.round(3).tolist()
    (20.0, [0.002, 0.002, 0.002])
    """

    start_s: float
    end_s: float
    rate: Array
    uncertainty: Array
    noise: Array

    def in_words(self, start: float, values: Array) -> str:
        """Return the rest for a reader, with a rate in deg/s; `start` is that of the recording in s."""
        numbers = ", ".join(
            f"{axis} {value:.6g} +- {spread:.2g}"
            for axis, value, spread in zip("xyz", values, np.degrees(self.uncertainty), strict=True)
        )
        walk = np.degrees(self.noise) * 60
        return (
            f"at rest from {self.start_s - start:.6g} s to {self.end_s - start:.6g} s after the start: {numbers} "
            f"deg/s; noise {', '.join(f'{x:.3g}' for x in walk)} deg/sqrt(h)"
        )


def rests(recording: Recording) -> list[Rest]:
    """Return the intervals in which a gyro rests, found by the variance of its rates.

    It is four or more windows of half a second (at least 8 samples) in a row. In each the standard deviation is at most
    1 deg/s, and within three times that of the calmest window or half a step of the samples; the mean is within 5
    deg/s, and within 0.5 deg/s of those of the neighbours.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    list of Rest
        In the order of time; each has the mean rate, its uncertainty and the noise.

    Raises
    ------
    InputTypeError
        If it is no recording.

    Examples
    --------
    >>> from strapgen import Recording
    >>> rates = np.concatenate([np.zeros((300, 3)), np.full((200, 3), 0.5)])
    >>> [(rest.start_s, rest.end_s) for rest in rests(Recording(0.0, 0.01, rates * 0.01))]
    [(0.0, 3.0)]
    """
    if not isinstance(recording, Recording):
        raise InputTypeError(f"recording is {checks.describe(recording)}; a Recording is needed")
    count = max(_LEAST_SAMPLES, round(_WINDOW_SECONDS / recording.interval))
    windows = len(recording.samples) // count
    if windows < _LEAST_WINDOWS:
        return []
    means, deviations = np.empty((windows, 3)), np.empty((windows, 3))
    resolution = np.full(3, np.inf)
    for first in range(0, windows, _TOGETHER):
        some = recording.samples[first * count : min(windows, first + _TOGETHER) * count]
        rates = np.asarray(some).reshape(-1, count, 3) / recording.interval
        part = slice(first, first + len(rates))
        means[part], deviations[part] = rates.mean(axis=1), rates.std(axis=1)
        steps = np.abs(np.diff(rates, axis=1))
        resolution = np.minimum(resolution, np.where(steps > 1e-12, steps, np.inf).min(axis=(0, 1)))
    deviation = np.linalg.norm(deviations, axis=1)
    floor = max(float(deviation.min()), float(np.linalg.norm(resolution[np.isfinite(resolution)])) / 2)
    calm = deviation <= min(_CALM * floor + 1e-12, _MOST_DEVIATION)
    calm &= np.linalg.norm(means, axis=1) <= _MOST_RATE
    changes = np.flatnonzero(np.abs(np.diff(means, axis=0)).max(axis=1) > _MOST_CHANGE)
    edges = {0, windows, *(int(k) + 1 for k in changes), *(int(k) + 1 for k in np.flatnonzero(np.diff(calm)))}
    ordered = sorted(edges)
    return [
        _rest(recording, begin * count, end * count if end < windows else len(recording.samples))
        for begin, end in pairwise(ordered)
        if calm[begin] and end - begin >= _LEAST_WINDOWS
    ]


def rest_between(recording: Recording, begin: float, end: float) -> Rest:
    """Return the mean rate between two times in s on the clock of a recording, as that of a rest."""
    first, stop = (round((time - recording.start) / recording.interval) for time in (begin, end))
    last = recording.start + recording.interval * len(recording.samples)
    if not (first >= 0 and stop <= len(recording.samples) and stop - first >= _LEAST_SAMPLES):
        raise InputError(
            f"bias from {begin:.12g} s to {end:.12g} s: at least {_LEAST_SAMPLES} samples between "
            f"{recording.start:.12g} s and {last:.12g} s are needed"
        )
    return _rest(recording, first, stop)


def longest_rest(recording: Recording) -> Rest:
    """Return the longest rest of a recording."""
    found = rests(recording)
    if not found:
        raise InputError(
            "the gyro never rests for 2 s; --bias-from 0:5 says from when to when it does, or --bias X,Y,Z the bias in "
            "deg/s"
        )
    return max(found, key=lambda rest: rest.end_s - rest.start_s)


def _rest(recording: Recording, first: int, stop: int) -> Rest:
    rates = np.asarray(recording.samples[first:stop]) / recording.interval
    parts = min(_PARTS, len(rates) // 2)
    each = len(rates) // parts
    means = rates[: parts * each].reshape(parts, each, 3).mean(axis=1)
    spread = means.std(axis=0, ddof=1)
    begin, end = (recording.start + recording.interval * k for k in (first, stop))
    walk = spread * math.sqrt(each * recording.interval)
    return Rest(begin, end, rates.mean(axis=0), spread / math.sqrt(parts), walk)


def earth_rate(latitude_deg: float, axes: str = "ned") -> Array:
    """Return the Earth's rate in rad/s, in level axes at a latitude.

    `axes`: "ned" for north, east and down, or "enu" for east, north and up.

    >>> (np.degrees(earth_rate(90, "enu")) * 3600).round(3) + 0.0
    array([ 0.   ,  0.   , 15.041])
    """
    if not abs(latitude_deg) <= 90:
        raise InputError(f"latitude is {latitude_deg:g} deg; -90 to 90 deg are allowed")
    angle = math.radians(latitude_deg)
    parts = _LEVEL[checks.choice("level axes", axes, _LEVEL)](math.sin(angle), math.cos(angle))
    return EARTH_RATE_RAD_S * np.array(parts)


def without_rate(recording: Recording, rate: Array) -> Recording:
    """Return a recording less a constant rate in rad/s, body axes."""
    return replace(recording, samples=recording.samples - rate * recording.interval)


def without_earth(recording: Recording, along: History, rate: Array) -> Recording:
    """Return a recording less the Earth's rate in rad/s, reference axes.

    `along`: the attitude along the recording against axes that do not turn with the Earth, and are the reference axes
    at its start.
    """
    from strapgen.lab.recordings.attitude_output import attitude_of

    middles: Array = recording.start + recording.interval * (
        np.arange(len(recording.samples), dtype=np.float64) + 0.5
    )
    # The reference axes turn about the Earth's rate, which stays as it is in them.
    attitudes = quaternions.interpolated(along.time, attitude_of(along), middles)
    sensed = np.einsum("nij,i->nj", quaternions.matrices(attitudes), rate)
    return replace(recording, samples=recording.samples - sensed * recording.interval)
