"""Body rates whose angle is in closed form but whose attitude is not: sums of cosines, and slews with their onsets.

A profile has the rate at an instant and the angle, the integral of the rate on each axis by itself, from which
increments follow as differences.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.ir.exceptions import InputError
from strapgen.run.backends import Backend, backend

Array = NDArray[np.float64]

#: Number of slews, the first of them, and the time from one to the next in s.
_SLEWS, _FIRST, _PERIOD = 8, 3.0037, 7.0
#: The first of the slews whose rate is linear at both ends, in s: no sample of 0.01 s begins there.
_FIRST_RAMP = 0.01 * (300 + 5 / 16)
#: Duration of a slew in s, from the middle of one onset to the middle of the other.
_SLEW = 1.2
#: Highest and lowest frequency of the random rate in Hz, and the number of its cosines on an axis.
_HIGHEST, _LOWEST, _COSINES = 50 / 3, 0.2, 30
#: Numbers whose roots set the frequencies, and those whose roots set the phases, of the axes x, y and z.
_FREQUENCY_ROOTS, _PHASE_ROOTS = (2, 3, 5), (7, 11, 13)
#: Substeps of the reference attitude in `KNOT`, and those in an onset that follows the hyperbolic tangent: a reference
#: with twice as many differs by less than 5e-13 rad after 60 s.
_SUBSTEPS, _ONSET_SUBSTEPS = 16, 64
#: Shortest onset in s; the longest is a slew.
_SHORTEST = 1e-4
#: Frequencies of the lines of a vibration in Hz.
_LINES = np.linspace(2, 30, 40)
#: Lowest bandwidth of a gyro in Hz.
_LOWEST_BANDWIDTH = 1e-3

#: Time from one attitude that is stored to the next in s.
KNOT = 0.01
#: Knots that are integrated together: some megabytes of rates.
_PART = 256
#: Gauss-Legendre nodes of a substep.
_NODES = 0.5 + np.array([-1.0, 0.0, 1.0]) * math.sqrt(15) / 10


@runtime_checkable
class RateProfile(Protocol):
    """A body rate whose integral is in closed form."""

    @property
    def substeps(self) -> int:
        """Number of substeps in `KNOT` that its reference attitude takes."""

    def rate(self, time: Any) -> Array:
        """Return the rate in rad/s at some times in s, (..., 3)."""

    def angle(self, time: Any) -> Array:
        """Return an integral of the rate that the gyro measures, in rad, up to some times, (..., 3)."""


@dataclass(frozen=True)
class CosineSum:
    """A sum of cosines on each axis: amplitude cos(frequency t + phase).

    >>> wave = CosineSum(np.ones((3, 1)), np.full((3, 1), 2.0), np.zeros((3, 1)))
    >>> wave.rate(0.0), wave.angle(np.pi / 4)
    (array([1., 1., 1.]), array([0.5, 0.5, 0.5]))
    """

    #: (3, K): in rad/s for a rate
    amplitudes: Array
    #: (3, K): in rad/s, above 0
    frequencies: Array
    #: (3, K): in rad
    phases: Array
    #: See `RateProfile`
    substeps: int = _SUBSTEPS
    #: What a gyro of limited bandwidth measures of it; None for one that passes on everything
    measured: CosineSum | None = None

    def rate(self, time: Any) -> Array:
        """Return the sum at some times, (..., 3)."""
        return self._waves(time, np.cos, self.amplitudes)

    def angle(self, time: Any) -> Array:
        """Return the integral of what a gyro measures up to some times, (..., 3); its mean is zero."""
        seen = self.measured or self
        return seen._waves(time, np.sin, seen.amplitudes / seen.frequencies)

    def _waves(self, time: Any, wave: Callable[[Array], Array], amplitudes: Array) -> Array:
        times = np.asarray(time, float)[..., None]
        moving = np.flatnonzero(amplitudes.any(axis=1))
        sums = np.zeros((*times.shape[:-1], len(moving)))
        for amplitude, frequency, phase in zip(
            amplitudes[moving].T, self.frequencies[moving].T, self.phases[moving].T, strict=True
        ):  # one after the other, so that the arrays stay small
            sums += amplitude * wave(times * frequency + phase)
        if len(moving) == len(amplitudes):
            return sums
        total = np.zeros((*times.shape[:-1], 3))
        total[..., moving] = sums
        return total

    def through_gyro(self, response: Response) -> CosineSum:
        """Return the sum with what a gyro measures of it, long after it began."""
        gain = response.gain(self.frequencies / (2 * np.pi))
        measured = CosineSum(self.amplitudes * np.abs(gain), self.frequencies, self.phases + np.angle(gain))
        return replace(self, measured=measured)


@dataclass(frozen=True)
class _Slews:
    """Eight slews of 1.2 s about different axes, on top of a sum of cosines."""

    background: CosineSum
    #: (8, 3): rate of each slew in rad/s
    axes: Array
    #: (8,): start of each slew in s: the middle of an onset by the hyperbolic tangent, the beginning of a ramp
    starts: Array
    #: Duration of an onset in s
    onset: float
    #: The rate of an onset as a fraction of its final one, from the time x since its start in units of `onset`;
    #: and the integral of that, less max(x, 0)
    shape: Callable[[Array], Array]
    integral: Callable[[Array], Array]
    #: See `RateProfile`
    substeps: int

    def rate(self, time: Any) -> Array:
        """Return the body rate at some times, (..., 3)."""
        begin, end = self._times(time)
        return self.background.rate(time) + (self.shape(begin) - self.shape(end)) @ self.axes

    def angle(self, time: Any) -> Array:
        """Return the integral of the body rate up to some times, (..., 3)."""
        begin, end = self._times(time)
        sharp = np.clip(begin * self.onset, 0, _SLEW)  # the integral of a slew that begins and ends at once
        soft = self.onset * (self.integral(begin) - self.integral(end))
        return self.background.angle(time) + (sharp + soft) @ self.axes

    def _times(self, time: Any) -> tuple[Array, Array]:
        """Return the times since both onsets of each slew, in units of an onset, (..., 8)."""
        since = np.asarray(time, float)[..., None] - self.starts
        return since / self.onset, (since - _SLEW) / self.onset


def _soft_integral(x: Array) -> Array:
    """Return the integral of (1 + tanh x)/2, less max(x, 0): log(1 + exp(-2|x|))/2."""
    result: Array = np.log1p(np.exp(-2 * np.abs(x))) / 2
    return result


def _ramp_integral(x: Array) -> Array:
    """Return the integral of a ramp from 0 to 1, less max(x, 0)."""
    inside = np.clip(x, 0, 1)
    return inside * inside / 2 - inside


def random_rate(rate: float) -> CosineSum:
    """Return a rate that looks random, without power above 50/3 Hz.

    `rate`: root mean square on each axis in rad/s.
    """
    return random_sum(rate, _FREQUENCY_ROOTS, _PHASE_ROOTS)


def random_sum(
    size: float, frequency_roots: tuple[int, int, int], phase_roots: tuple[int, int, int]
) -> CosineSum:
    """Return a vector that looks random, without power above 50/3 Hz, see `random_rate`."""
    number = np.arange(1, _COSINES + 1)
    frequencies = _LOWEST + (_HIGHEST - _LOWEST) * _fractions(frequency_roots, number)
    amplitudes = np.full(frequencies.shape, size * math.sqrt(2 / _COSINES))
    return CosineSum(amplitudes, 2 * np.pi * frequencies, 2 * np.pi * _fractions(phase_roots, number))


def vibration_rate(angle: float, gyro: float) -> CosineSum:
    """Return the rate of a vibration of forty lines from 2 Hz to 30 Hz, of which y is a quarter period behind x.

    `angle`: root mean square of the angle on each axis in rad, the same in every line. `gyro`: bandwidth of the
    gyro in Hz, a Butterworth filter of second order; infinite for one that passes on everything.
    """
    if gyro < _LOWEST_BANDWIDTH:
        raise InputError(f"gyro_hz is {gyro:g}; at least {_LOWEST_BANDWIDTH:g} is needed")
    frequencies = np.broadcast_to(2 * np.pi * _LINES, (3, _LINES.size))
    phases = 2 * np.pi * _fractions(_PHASE_ROOTS, np.arange(1, _LINES.size + 1))
    phases[1] = phases[0] - np.pi / 2
    motion = CosineSum(frequencies * (angle * math.sqrt(2 / _LINES.size)), frequencies, phases)
    if gyro == math.inf:
        return motion
    return motion.through_gyro(Response("butterworth", order=2, frequency_hz=Fraction(gyro)))


def slew(onset: float, rate: float) -> _Slews:
    """Return slews whose rate follows the hyperbolic tangent at both ends.

    `onset`: time in s in which the hyperbolic tangent goes from 0 to tanh 1. `rate`: in rad/s.
    """
    _check_onset(onset)
    axes, sway = _directions(), _sway()
    substeps = max(_SUBSTEPS, math.ceil(_ONSET_SUBSTEPS * KNOT / onset))
    starts = _FIRST + _PERIOD * np.arange(_SLEWS, dtype=np.float64)
    return _Slews(sway, rate * axes, starts, onset, lambda x: (1 + np.tanh(x)) / 2, _soft_integral, substeps)


def ramps(onset: float, rate: float) -> _Slews:
    """Return slews whose rate is linear at both ends.

    `onset`: duration of a ramp in s. `rate`: in rad/s.
    """
    _check_onset(onset)
    substeps = onset / KNOT * _SUBSTEPS
    if abs(substeps - round(substeps)) > 1e-9:
        unit = f"{KNOT:g}/{_SUBSTEPS} s"
        raise InputError(
            f"onset_s is {onset:g}; a multiple of {unit} is needed, the reference attitude's substep"
        )
    axes, sway = _directions(), _sway()
    starts = _FIRST_RAMP + _PERIOD * np.arange(_SLEWS, dtype=np.float64)
    return _Slews(sway, rate * axes, starts, onset, lambda x: np.clip(x, 0, 1), _ramp_integral, _SUBSTEPS)


def _check_onset(onset: float) -> None:
    if not _SHORTEST <= onset <= _SLEW:
        raise InputError(f"onset_s is {onset:g}; {_SHORTEST:g} to {_SLEW:g} is needed")


def _directions() -> Array:
    """Return the axes of the slews, (8, 3)."""
    axes = np.sin(np.multiply.outer(np.arange(_SLEWS), (1.7, 2.3, 2.9)) + np.array([0.3, 1.1, 2.0]))
    directions: Array = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return directions


def _sway() -> CosineSum:
    """Return the slow rate on top of which the slews are: (20 sin 1.3 t, 30 sin(0.9 t + 0.5), 25 sin(0.7 t + 1))."""
    return CosineSum(
        np.radians([[20.0], [30.0], [25.0]]),
        np.array([[1.3], [0.9], [0.7]]),
        np.array([[0.0], [0.5], [1.0]]) - np.pi / 2,
    )


def _fractions(roots: tuple[int, ...], number: NDArray[np.int_]) -> Array:
    """Return the fractional parts of multiples of square roots, (3, K)."""
    fractions: Array = np.outer(np.sqrt(roots), number) % 1
    return fractions


class ReferenceAttitude:
    """The attitude that a body rate leads to, from the identity at time 0 on.

    `rate`: ``rate(times)`` returns body rates in rad/s, (..., 3), of times in s.

    >>> turn = ReferenceAttitude(lambda t: np.array([0, 0, np.pi]) * np.asarray(t)[..., None], 16)
    >>> turn(np.array([1.0]))[0].round(12) + 0.0  # the integral of pi t is a right angle after 1 s
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """

    def __init__(self, rate: Callable[[Array], Array], substeps: int) -> None:
        self._rate, self._substeps = rate, substeps
        self._states: Array = _magnus().identity[None]

    def __call__(self, time: Any) -> Array:
        """Return direction cosine matrices, body to reference.

        `time`: times in s, none below 0. Returns (..., 3, 3).
        """
        times = np.asarray(time, float)
        if times.min(initial=0.0) < 0:
            raise InputError(f"time is {times.min():g} s; the attitude is integrated from 0 on")
        matrices: Array = _magnus().matrices(self._at(times.ravel()))
        return matrices.reshape(*times.shape, 3, 3)

    def _at(self, times: Array) -> Array:
        """Return Euler parameters at some times, (N, 4)."""
        places = times / KNOT
        nearest = np.rint(places)
        on_knot = np.abs(places - nearest) <= 4 * np.finfo(float).eps * nearest
        knots = np.where(on_knot, nearest, np.floor(places)).astype(int)
        self._extend(int(knots.max(initial=0)))
        states: Array = self._states[knots]
        between = np.flatnonzero(~on_knot)
        for part in np.array_split(between, -(-len(between) // _PART)) if len(between) else []:
            states[part] = self._from_knots(states[part], knots[part], times[part])
        return states

    def _extend(self, last: int) -> None:
        """Store the states up to a knot, in whole parts: no bit depends on what was asked for before."""
        parts = [self._states]
        for first in range(len(self._states) - 1, last, _PART):
            starts = (first + np.arange(_PART * self._substeps) / self._substeps) * KNOT
            vectors = self._node_rotations(starts, np.full(starts.shape, KNOT / self._substeps))
            states = _magnus().propagate(vectors, self._substeps, initial=parts[-1][-1])[1:]
            # The length of a product of rotations is 1 but for rounding.
            parts.append(states / np.linalg.norm(states, axis=1, keepdims=True))
        self._states = np.concatenate(parts)

    def _from_knots(self, states: Array, knots: NDArray[np.int_], times: Array) -> Array:
        """Return the states at times between knots, each from its knot on."""
        step = KNOT / self._substeps
        starts = knots[:, None] * KNOT + np.arange(self._substeps) * step
        lengths = np.clip(times[:, None] - starts, 0, step)
        vectors = self._node_rotations(starts, lengths)
        result: Array = _magnus().propagate(vectors, self._substeps, initial=states)[:, -1]
        return result

    def _node_rotations(self, starts: Array, lengths: Array) -> Array:
        """Return the rates at the nodes of some substeps, each times its length, (..., 3, 3)."""
        rates = self._rate(starts[..., None] + lengths[..., None] * _NODES)
        vectors: Array = rates * lengths[..., None, None]
        return vectors


@lru_cache(maxsize=1)
def _magnus() -> Backend:
    """Return the step that integrates."""
    return backend(catalogue.choose_step("euler", "magnus6", rates=True))
