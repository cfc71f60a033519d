"""`MeasurementUnit` turns true increments into those of sensors with errors, part by part from the start of a run on.

The deterministic errors are kernels of the catalogue at the true values: ``imu-errors``, ``pulse-errors`` and
``gyro-pulse-errors`` for scale factors by sign, ``lock-in-errors``, and ``torquer-heating-errors``.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.lab.sensor_errors.instruments import InstrumentErrors, TriadErrors
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]

#: Labels of the elements of a full matrix of coefficients.
_PLACES = [f"{row}{column}" for row in "xyz" for column in "xyz"]
#: Causes that leave the errors of an increment a function of this increment alone.
_STEADY = ("bias", "scale", "misalignment", "terms", "lock-in")
#: Most pulses that can be counted, since a double represents every whole number up to here.
_MOST_PULSES = 2.0**53

#: Samples that a linear recursion takes together.
_BLOCK = 128
#: Standard deviations that no instant of a sample departs by.
_FARTHEST = 10.0
#: Most sampling intervals by which a sample is late.
_MOST_LATE = 1_000_000


class MeasurementUnit:
    """The sensors of one run.

    Parameters
    ----------
    errors : InstrumentErrors
    interval : float
        From sample to sample in s.
    run : int, optional
        Number of the run: each has random numbers of its own.

    Examples
    --------
    >>> unit = MeasurementUnit(InstrumentErrors(gyro=TriadErrors(bias=np.array([1e-3, 0, 0]))), 0.01)
    >>> unit(np.full((2, 3), 0.5))[0][:, 0] - 0.5
    array([1.e-05, 1.e-05])
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self.errors.title or 'sensors with errors'}, a sample every {self._interval:g} s"

    def __init__(self, errors: InstrumentErrors, interval: float, run: int = 0) -> None:
        self._interval = interval
        self._streams = _Streams(errors.seed, run)
        self.errors: InstrumentErrors = _draw(errors, self._streams) if errors.drawn else errors
        self._causes = {*self.errors.causes}
        gyro, accelerometer = self.errors.gyro, self.errors.accelerometer
        self._gyro = _Triad(gyro, self.errors, "gyro", interval, self._streams)
        self._accelerometer = _Triad(accelerometer, self.errors, "accelerometer", interval, self._streams)
        self._heating = _Heating(self.errors, interval) if "heating" in self._causes else None
        self._loss = _Loss(self.errors, self._streams) if "lost samples" in self._causes else None
        self._samples = 0
        self._bounded = (
            [(bounded_noise(self.errors.output_noise.decay), np.zeros(2))] * 3
            if "output noise" in self._causes
            else []
        )

    def __call__(self, angle: Array, velocity: Array | None = None) -> tuple[Array, Array]:
        """Return what the sensors measure.

        `angle` (n, 3): true angle increments after those of the call before, in rad, body axes. `velocity` (n, 3):
        true velocity increments in m/s, body axes; by default they are zero. Returns (n, 3).
        """
        velocity = np.zeros_like(angle) if velocity is None else velocity
        if not self._causes or not len(angle):
            return angle, velocity
        times = None if not {"delay", "jitter"} & self._causes else self._instants(len(angle))
        angle, velocity = self._gyro.sampled(angle, times), self._accelerometer.sampled(velocity, times)
        angle, velocity = self._by_kernels(angle, velocity)
        if "warm-up" in self._causes:
            angle = angle + self._warming(len(angle))
        if "lock-in" in self._causes:
            angle = evaluator("lock-in-errors")(angle, self._interval, self.errors.gyro.lock_in)
        if self._heating is not None:
            angle, velocity = self._heating(angle, velocity)
        if "scale" in self._causes:
            angle, velocity = self._gyro.scaled(angle), self._accelerometer.scaled(velocity)
        angle, velocity = self._gyro.noisy(angle), self._accelerometer.noisy(velocity)
        if "output noise" in self._causes:
            angle = angle + self._output_noise(len(angle))
        angle, velocity = self._gyro.counted(angle), self._accelerometer.counted(velocity)
        if self._loss is not None:
            angle, velocity = self._loss(angle, velocity)
        self._samples += len(angle)
        return angle, velocity

    def _instants(self, count: int) -> Array:
        """Return how far the instants of samples are from their times, in standard deviations, (n, 1)."""
        if not self.errors.sampling.jitter:
            return np.zeros((count, 1))
        return self._streams.normal("jitter", count, 1)

    def _by_kernels(self, angle: Array, velocity: Array) -> tuple[Array, Array]:
        """Return increments with biases, misalignments and terms."""
        if not {"bias", "misalignment", "terms"} & self._causes:
            return angle, velocity
        gyro, accelerometer = self.errors.gyro, self.errors.accelerometer
        values = {
            **{f"D0_{axis}": bias for axis, bias in zip("xyz", gyro.bias, strict=True)},
            **dict(zip((f"K_{place}" for place in _PLACES), gyro.misalignment.flat, strict=True)),
            **{f"A0_{axis}": bias for axis, bias in zip("xyz", accelerometer.bias, strict=True)},
            **dict(zip((f"M_{place}" for place in _PLACES), accelerometer.misalignment.flat, strict=True)),
            **gyro.terms,
            **accelerometer.terms,
        }
        errors = evaluator("imu-errors")
        coefficients = [
            np.array([values.get(name, 0.0) for name in signal.elements])
            for signal in errors.function.inputs[4:]
        ]
        measured: tuple[Array, Array] = errors(
            angle, velocity, self._interval, 1 / self._interval, *coefficients
        )
        return measured

    def _warming(self, count: int) -> Array:
        """Return the integrals of the warm-up rate over the next intervals."""
        warm, begin = self.errors.warm_up, self._samples
        time = np.arange(begin, begin + count)[:, None] * self._interval
        # The integral of exp(-t/tau) over an interval is tau (1 - exp(-T/tau)) exp(-t/tau).
        faded = -warm.tau * np.expm1(-self._interval / warm.tau) * np.exp(-time / warm.tau)
        increments: Array = warm.rate * (self._interval - faded)
        return increments

    def _output_noise(self, count: int) -> Array:
        white = self.errors.output_noise.rms * self._streams.normal("output noise", count)
        noise = np.empty_like(white)
        for axis, (recursion, state) in enumerate(self._bounded):
            noise[:, axis], state = recursion.run(white[:, axis], state)
            self._bounded[axis] = recursion, state
        return noise


def steady(errors: InstrumentErrors) -> InstrumentErrors:
    """Return the errors that make of an increment something that depends on this increment alone."""
    return errors.only(*_STEADY)


class _Triad:
    """Three gyros or accelerometers: their response, their noise and their pulses."""

    def __init__(
        self, triad: TriadErrors, errors: InstrumentErrors, name: str, interval: float, streams: _Streams
    ) -> None:
        self._triad, self._name, self._interval, self._streams = triad, name, interval, streams
        self._lags = [_Lag(one, interval) if one.changes else None for one in triad.responses]
        self._times = _SampleTimes(triad.delay, errors.sampling.jitter, interval)
        self._drift = np.zeros((1, 3))
        self._angle: Array | None = None
        self._pulses = np.zeros((1, 3))

    def sampled(self, row: Array, departures: Array | None) -> Array:
        """Return increments of the limited bandwidth, at the instants of the samples."""
        columns = [axis if lag is None else lag(axis) for axis, lag in zip(row.T, self._lags, strict=True)]
        row = np.stack(columns, axis=1)
        if departures is None or not (self._triad.delay.any() or departures.any()):
            return row
        return self._times(row, departures)

    def scaled(self, row: Array) -> Array:
        """Return increments with the scale factors of their signs."""
        plus, minus = self._triad.scale_plus, self._triad.scale_minus
        if not (plus.any() or minus.any()):
            return row
        gyro = self._name == "gyro"
        values = (0.0, 0.0) if gyro else (0.0, 0.0, 0.0)  # no bias, no offset, no error but by sign
        kernel = evaluator("gyro-pulse-errors" if gyro else "pulse-errors")
        return np.asarray(kernel(row, self._interval, *values, plus, minus))

    def noisy(self, row: Array) -> Array:
        """Return increments with white noise and with the random walk of the bias."""
        triad, count, root = self._triad, len(row), self._interval**0.5
        if triad.noise.any():
            row = row + triad.noise * root * self._streams.normal(f"{self._name} noise", count)
        if triad.random_walk.any():
            # The walk w has steps K sqrt(T) n; its integral over one is T (w + K sqrt(T) (n/2 + m/sqrt(12))).
            along = self._streams.normal(f"{self._name} walk", count)
            beside = self._streams.normal(f"{self._name} walk inside", count)
            strength = triad.random_walk * root
            drift = np.cumsum(np.concatenate([self._drift, strength * along]), axis=0)
            self._drift = drift[-1:]
            row = row + self._interval * (drift[:-1] + strength * (along / 2 + beside / 12**0.5))
        return row

    def counted(self, row: Array) -> Array:
        """Return increments in whole pulses; what is left of one goes into the next, and the first begins anywhere."""
        pulse = self._triad.pulse
        if not pulse.any():
            return row
        size = np.where(pulse > 0, pulse, 1.0)
        if self._angle is None:
            self._angle = (self._streams.uniform(f"{self._name} pulses", 1) - 0.5) * size
        angle = np.cumsum(np.concatenate([self._angle, row]), axis=0)
        counts = np.rint(angle[1:] / size)
        if not np.abs(counts).max() < _MOST_PULSES:
            raise InputError(
                f"the pulse of the {self._name} is too small: a run has more than can be counted"
            )
        before, self._angle, self._pulses = self._pulses, angle[-1:], counts[-1:]
        return np.where(pulse > 0, np.diff(counts, axis=0, prepend=before) * size, row)


class _Heating:
    """Gyros of the layout at 45 degrees whose torquers heat up, one sample after the other."""

    def __init__(self, errors: InstrumentErrors, interval: float) -> None:
        heating = errors.heating
        self._torques, self._separate = evaluator("torques-45"), evaluator("separate-45")
        self._step = evaluator("torquer-heating-errors")
        # Without an unbalance the torques hold no acceleration, and the accelerometers are others.
        self._alone = not heating.unbalance
        self._unbalance = heating.unbalance or 1.0
        self._constants = (-np.expm1(-interval / heating.tau), heating.gain, 1 / interval)
        self._deviation = np.zeros(3)

    def __call__(self, angle: Array, velocity: Array) -> tuple[Array, Array]:
        sensed = np.zeros_like(velocity) if self._alone else velocity
        torques = self._torques(angle, sensed, self._unbalance)
        indicated = np.empty_like(torques)
        for number, torque in enumerate(torques):
            self._deviation, indicated[number] = self._step(self._deviation, torque, *self._constants)
        rate, acceleration = self._separate(indicated, 1 / self._unbalance)
        return rate, velocity if self._alone else acceleration


class _Loss:
    """Samples that do not arrive, gyros and accelerometers together."""

    def __init__(self, errors: InstrumentErrors, streams: _Streams) -> None:
        self._sampling, self._streams = errors.sampling, streams
        self._late = np.zeros(6)
        self._last: Array | None = None

    def __call__(self, angle: Array, velocity: Array) -> tuple[Array, Array]:
        row = np.concatenate([angle, velocity], axis=1)
        last = row[0] if self._last is None else self._last
        lost = self._streams.uniform("lost samples", len(row), 1)[:, 0] < self._sampling.lost
        result = np.where(lost[:, None], 0.0, row)
        places = np.arange(len(row))
        before = np.maximum.accumulate(np.where(lost, -1, places))  # the last that arrived; -1 for none
        if self._sampling.lost_as == "repeat":
            result = np.where((before < 0)[:, None], last, row[before])
        elif self._sampling.lost_as == "late":
            self._add_late(row, lost, result)
        self._last = result[-1]
        return result[:, :3], result[:, 3:]

    def _add_late(self, row: Array, lost: NDArray[np.bool_], result: Array) -> None:
        """Add the lost increments to the next sample that arrives."""
        if not lost[0]:
            result[0] += self._late
            self._late = np.zeros(6)
        for place in np.flatnonzero(lost):
            self._late = self._late + row[place]
            if place + 1 < len(row) and not lost[place + 1]:
                result[place + 1] += self._late
                self._late = np.zeros(6)


def _draw(errors: InstrumentErrors, streams: _Streams) -> InstrumentErrors:
    """Return errors whose constants are drawn from the normal distributions that were stated."""

    def drawn(name: str, values: Array) -> Array:
        if not values.any():
            return values
        return values * streams.normal(name, 1, values.size).reshape(values.shape)

    def triad(part: TriadErrors, name: str) -> TriadErrors:
        plus, minus = part.scale_plus, part.scale_minus
        drawn_plus = drawn(f"{name} scale", plus)
        other = drawn(f"{name} scale of the other sign", minus) if (plus != minus).any() else minus
        return replace(
            part,
            bias=drawn(f"{name} bias", part.bias),
            scale_plus=drawn_plus,
            scale_minus=np.where(plus == minus, drawn_plus, other),
            misalignment=drawn(f"{name} misalignment", part.misalignment),
            terms={
                term: value * float(streams.normal(term, 1, 1)[0, 0]) for term, value in part.terms.items()
            },
        )

    return replace(
        errors,
        drawn=False,
        gyro=triad(errors.gyro, "gyro"),
        accelerometer=triad(errors.accelerometer, "accelerometer"),
    )


@dataclass(frozen=True)
class _LinearRecursion:
    """A recursion ``y = c s + d x``, ``s' = a s + b x`` on single numbers x and y."""

    #: (m, m)
    a: Array
    #: (m,)
    b: Array
    c: Array
    d: float

    def __post_init__(self) -> None:
        powers = [np.eye(len(self.b))]
        for _ in range(_BLOCK):
            powers.append(self.a @ powers[-1])
        weights = np.array([self.d, *(float(self.c @ power @ self.b) for power in powers[:-1])])
        lags = np.subtract.outer(np.arange(_BLOCK), np.arange(_BLOCK))
        object.__setattr__(self, "_direct", np.where(lags >= 0, weights[np.maximum(lags, 0)], 0.0))
        object.__setattr__(self, "_free", np.array([self.c @ power for power in powers[:-1]]))
        object.__setattr__(self, "_inflow", np.array([power @ self.b for power in powers[:-1]]))
        object.__setattr__(self, "_powers", powers)

    def run(self, row: Array, state: Array) -> tuple[Array, Array]:
        """Return the results of a row of numbers, (n,), from a state on, (m,), and the state after it."""
        parts: Any = self
        result = np.empty_like(row)
        for first in range(0, len(row), _BLOCK):
            block = row[first : first + _BLOCK]
            count = len(block)
            result[first : first + count] = (
                parts._free[:count] @ state + parts._direct[:count, :count] @ block
            )
            state = parts._powers[count] @ state + block @ parts._inflow[:count][::-1]
        return result, state


def filtered(response: Response, interval: float) -> _LinearRecursion:
    """Return the filter of a response as a recursion on increments.

    It is exact for a rate that is constant over each interval. The state is the rate that comes out, in increments an
    interval, and its derivatives; the result its integral, or for instants the rate as the interval begins.

    `interval`: in s.

    >>> from fractions import Fraction
    >>> gyro = Response(frequency_hz=Fraction(80), damping=Fraction(7, 10))
    >>> filtered(gyro, 0.001).run(np.ones(3), np.array([1.0, 0.0]))[0].round(12)
    array([1., 1., 1.])
    """
    instants = response.input == "instants"
    if response.frequency_hz is None:  # the rate as an interval begins is the mean of those on both sides
        half = np.array([0.5])
        return _LinearRecursion(np.zeros((1, 1)), 2 * half, half, 0.5)
    turn = 2 * np.pi * float(response.frequency_hz) * interval  # w times the interval, the unit of time
    *below, highest = map(float, response.polynomial)
    order = len(below)
    # Of the rate, its derivatives, the integral of the rate, and the constant that goes in.
    system = np.zeros((order + 2, order + 2))
    system[: order - 1, 1:order] = turn * np.eye(order - 1)
    system[order - 1, :order], system[order - 1, -1] = np.array(below) * -turn / highest, turn / highest
    system[order, 0] = 1.0
    step = _exponential(system)
    integral = (np.eye(order)[0], 0.0) if instants else (step[order, :order], float(step[order, -1]))
    return _LinearRecursion(step[:order, :order], step[:order, -1], *integral)


#: Taps in place of a table, and the part of half the sampling rate up to which they are fitted to it.
_TABLE_TAPS, _FITTED = 64, 0.9


def _table_taps(response: Response, interval: float) -> Array:
    """Return taps whose response is nearest to that of a table, the newest first; they pass a constant rate as it does.

    `interval`: from tap to tap in s.
    """
    turns = np.linspace(0.0, _FITTED * np.pi, 8 * _TABLE_TAPS)
    wanted = Response(table=response.table).gain(turns / (2 * np.pi * interval))
    waves = np.exp(-1j * np.outer(turns, np.arange(_TABLE_TAPS)))
    columns, right = (np.concatenate([one.real, one.imag]) for one in (waves, wanted))
    taps = np.linalg.lstsq(columns, right, rcond=1e-9)[0]
    return np.asarray(taps * (wanted[0].real / taps.sum()))


def bounded_noise(decay: float) -> _LinearRecursion:
    """Return ``b[n] = A b[n-1] + (1 - A)(w[n] - w[n-1])`` as a recursion on w; the state is b and w of the time before.

    The variance for unit w is 2(1-A)^2/(1+A), that of the running sum (1-A)/(1+A).
    """
    gain = 1 - decay
    return _LinearRecursion(
        np.array([[decay, -gain], [0.0, 0.0]]), np.array([gain, 1.0]), np.array([decay, -gain]), gain
    )


def _exponential(matrix: Array) -> Array:
    """Return the exponential of a matrix, by halving and its series."""
    halvings = max(0, int(np.ceil(np.log2(max(float(np.abs(matrix).sum(axis=1).max()), 1e-300)))) + 4)
    small = matrix / 2.0**halvings
    result = term = np.eye(len(matrix))
    for k in range(1, 14):  # the norm is at most 1/16: 16**-14/14! is far below round-off
        term = term @ small / k
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


class _Lag:
    """A response but for its delay, part by part; before the first increment its rate has held for ever."""

    def __init__(self, response: Response, interval: float) -> None:
        self._parts, inner = response.decimation, interval / response.decimation
        instants = response.input == "instants"
        has_recursion = response.frequency_hz is not None or instants
        self._recursion = filtered(response, inner) if has_recursion else None
        self._last = 0 if instants else self._parts - 1  # the newest internal sample of an interval
        self._weights = np.array([float(weight) for weight in response.weights]) * self._parts
        if response.table:
            self._weights = np.convolve(self._weights, _table_taps(response, inner))
        self._state, self._history = np.zeros(0), np.zeros(0)

    def __call__(self, row: Array) -> Array:
        """Return what comes out for increments, (n,)."""
        inner = np.repeat(row / self._parts, self._parts)
        if not len(self._history):
            self._history = np.full(max(1, len(self._weights) - 1), inner[0])
            if self._recursion is not None:
                self._state = inner[0] * np.eye(len(self._recursion.b))[0]
        if self._recursion is not None:
            inner, self._state = self._recursion.run(inner, self._state)
        whole = np.concatenate([self._history, inner])
        self._history = whole[len(inner) :]
        result: Array = np.convolve(whole, self._weights)[len(self._history) : len(whole)]
        return result[self._last :: self._parts]


class _SampleTimes:
    """Increments between instants that are late and unsteady, part by part.

    The angle between two exact instants is taken as linear; an instant after its time takes the rate of the interval
    before it. Before the first increment its rate has held for ever.
    """

    def __init__(self, delay: Array, jitter: float, interval: float) -> None:
        self._delay, self._jitter = delay / interval, jitter / interval
        latest = float(self._delay.max()) + _FARTHEST * self._jitter
        if latest > _MOST_LATE:
            raise InputError(
                f"a sample is up to {latest:.6g} sampling intervals late by delay and jitter; up to {_MOST_LATE} are "
                "possible"
            )
        self._depth = int(np.ceil(latest)) + 2
        self._history: Array | None = None
        self._before = self._delay[None]  # how late the sample before is, in intervals

    def __call__(self, row: Array, departures: Array) -> Array:
        """Return the increments between the instants, (n, 3).

        `row` (n, 3): increments between exact instants. `departures` (n, 1): departures of the instants from their
        times in standard deviations of the jitter.
        """
        if self._history is None:
            self._history = np.tile(row[0], (self._depth, 1))
        whole = np.concatenate([self._history, row])
        late = self._delay - self._jitter * np.clip(departures, -_FARTHEST, _FARTHEST)
        late = np.concatenate([self._before, late])
        angle = np.cumsum(whole, axis=0)
        # `angle[k]` is that at the end of interval k; the sample before the first stands at the end of the history.
        ends = np.arange(self._depth - 1, len(whole))[:, None]
        behind = np.maximum(np.floor(late), 0.0)
        place = ends - behind.astype(np.int64)
        axes = np.arange(3)
        there = angle[place, axes] - (late - behind) * whole[place, axes]
        self._history, self._before = whole[len(row) :], late[-1:]
        exact = (self._delay == 0) & (self._jitter == 0)
        return np.where(exact, row, np.diff(there, axis=0))


class _Streams:
    """The random numbers of one run.

    A stream depends on the seed, the number of the run and its name alone: a cause that is switched off takes nothing
    from the others, and a run that is read in parts has the numbers of a whole one.

    >>> one, other = _Streams(1, 0), _Streams(1, 0)
    >>> _ = one.normal("noise", 5)
    >>> bool((one.normal("walk", 4) == other.normal("walk", 4)).all())
    True
    """

    def __init__(self, seed: int, run: int) -> None:
        self._key = (seed, run)
        self._generators: dict[str, list[np.random.Generator]] = {}

    def normal(self, name: str, count: int, width: int = 3) -> Array:
        """Return the next standard normal numbers of a cause, (count, width), each axis from its stream."""
        return np.stack([stream.standard_normal(count) for stream in self._of(name, width)], axis=-1)

    def uniform(self, name: str, count: int, width: int = 3) -> Array:
        """Return the next numbers of a cause from 0 to below 1, (count, width)."""
        return np.stack([stream.random(count) for stream in self._of(name, width)], axis=-1)

    def _of(self, name: str, width: int) -> list[np.random.Generator]:
        if name not in self._generators:
            seed, run = self._key
            label = zlib.crc32(name.encode())
            self._generators[name] = [
                np.random.Generator(
                    np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(run, label, axis)))
                )
                for axis in range(width)
            ]
        return self._generators[name]
