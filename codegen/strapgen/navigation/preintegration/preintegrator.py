"""Preintegration in Python, with the numbers of the generated C++."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from strapgen.catalogue import Choice, choose
from strapgen.catalogue.methods import windows
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.navigation.preintegration import INPUTS, INTERPOLATION, POINTS, resampling
from strapgen.run.backends import evaluator
from strapgen.run.evaluators import Array, Evaluator

#: A stamp is at most so many nominal intervals after the one before.
LONGEST = 1.5
#: By how much of an interval samples may begin late or end early: by their jitter.
SLACK = 0.1
_SECOND = 1e-9
#: The kernel of the rotation after a change of the biases.
UPDATE = "dcm-update-12"


class PreintegrationStatus(IntEnum):
    """What is wrong with a sample or with an interval.

    Examples
    --------
    >>> PreintegrationStatus(-3).name
    'GAP'
    """

    #: The stamp is before the last one
    BACK = -1
    #: The stamp is the last one
    REPEATED = -2
    #: The stamp is more than 1.5 nominal intervals after the last one
    GAP = -3
    #: The interval, with the samples that its ends need, lies outside of what was pushed and is still held
    OUTSIDE = -4
    #: The interval does not end after its beginning
    ORDER = -5
    #: A number is not finite
    NOT_FINITE = -6


class PreintegrationError(InputError):
    """A sample or an interval that is refused; nothing has changed.

    Attributes
    ----------
    status : PreintegrationStatus
        The reason, with the number that the C++ returns.

    Examples
    --------
    >>> raise PreintegrationError(PreintegrationStatus.GAP, "a sample is lost")
    Traceback (most recent call last):
        ...
    strapgen.navigation.preintegration.preintegrator.PreintegrationError: a sample is lost
    """

    def __init__(self, status: PreintegrationStatus, reason: str) -> None:
        super().__init__(reason)
        self.status: PreintegrationStatus = status


def choose_method(method: str | Path) -> Choice:
    """Return the step by a built-in window or pair, a file of one, or one kept sample ("kept-sample")."""
    if str(method) == "kept-sample":
        return choose("preintegrate", "coning-combined", 1, previous=1)
    return choose("preintegrate", windows.named_or_read(method))


@dataclass(frozen=True)
class Preintegrated(Records):
    """Rotation, velocity and position between two instants.

    Parameters
    ----------
    rotation : array, (..., 3, 3)
        From the body axes at the last instant to those at the first one.
    velocity, position : array, (..., 3)
        In m/s and m, axes at the first instant, without gravity, the Earth rate and the velocity at the first instant.
    covariance : array, (..., 9, 9)
        Of the right rotation error, R_computed = R_true exp(theta x), in rad, and of velocity and position.
    jacobian : array, (..., 9, 6)
        Derivatives of rotation (right), velocity and position by the biases of rate and specific force.
    duration : array, (...)
        From the first to the last instant in s.
    rate_bias, force_bias : array, (3,)
        The biases that were taken off, in rad/s and m/s^2.

    Examples
    --------
    >>> still = Preintegrated(np.eye(3), *np.zeros((2, 3)), np.zeros((9, 9)), np.ones((9, 6)), 0.5, *np.zeros((2, 3)))
    >>> still.at([0.0, 0.0, 0.0], [0.5, 0.0, 0.0]).velocity
    array([0.5, 0.5, 0.5])
    """

    rotation: Array
    velocity: Array
    position: Array
    covariance: Array
    jacobian: Array
    duration: Array
    rate_bias: Array
    force_bias: Array

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"over {np.max(self.duration):g} s"

    def __getitem__(self, place: Any) -> Preintegrated:
        """Return one of many intervals, or several, by their place in the shape of the instants."""
        parts = ("rotation", "velocity", "position", "covariance", "jacobian", "duration")
        return replace(self, **{name: getattr(self, name)[place] for name in parts})

    def at(self, rate_bias: Any, force_bias: Any) -> Preintegrated:
        """Return rotation, velocity and position for other biases, to first order in their change.

        Parameters
        ----------
        rate_bias, force_bias : array_like, (3,)
            In rad/s and m/s^2.

        Examples
        --------
        >>> still = Preintegrated(np.eye(3), *np.zeros((2, 3)), np.zeros((9, 9)), np.eye(9, 6), 1.0, *np.zeros((2, 3)))
        >>> still.at([0.0, 0.0, 0.1], [0.0, 0.0, 0.0]).rotation[0].round(4)
        array([ 0.995 , -0.0998,  0.    ])
        """
        new = [_vector(*pair) for pair in (("rate_bias", rate_bias), ("force_bias", force_bias))]
        change = self.jacobian @ (np.concatenate(new) - np.concatenate([self.rate_bias, self.force_bias]))
        turn = np.asarray(_update()(np.eye(3), change[..., :3]))
        return replace(
            self,
            rotation=self.rotation @ turn,
            velocity=self.velocity + change[..., 3:6],
            position=self.position + change[..., 6:],
            rate_bias=new[0],
            force_bias=new[1],
        )


class Preintegrator:
    """Preintegrates stamped samples of a gyro and an accelerometer between any two instants.

    Parameters
    ----------
    window : str or path, optional
        A built-in window or pair, a file of one, as for a sensor's response, or "kept-sample".
    sample_hz : number
        Nominal sampling rate in Hz.
    input : str, optional
        "increments" since the stamp before, in rad and m/s; "rates", their means since the stamp before, in rad/s and
        m/s^2; or "instants", the same at the stamp.
    rate_noise, force_noise : float, optional
        Density of the noise in rad/s/sqrt(Hz) and m/s^2/sqrt(Hz).

    Attributes
    ----------
    previous, ahead : int
        Nominal intervals before the first instant and after the last one for which samples are needed.

    Raises
    ------
    InputError
        If a name or a number is not allowed.

    Examples
    --------
    >>> imu = Preintegrator("pair-1-5", sample_hz=200, input="rates", rate_noise=1e-4)
    >>> for k in range(40):
    ...     imu.push(5_000_000 * k, [0.0, 0.0, 1.0], [0.0, 0.0, 9.8])
    >>> factor = imu.between(31_000_000, 131_000_000)
    >>> factor.rotation[0].round(6), factor.velocity.round(6)
    (array([ 0.995004, -0.099833,  0.      ]), array([0.  , 0.  , 0.98]))
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{self._choice.kernel}, {len(self._stamps)} samples"

    def __init__(
        self,
        window: str | Path = "pair-1-8",
        *,
        sample_hz: Any,
        input: str = "increments",
        rate_noise: float = 0.0,
        force_noise: float = 0.0,
    ) -> None:
        checks.choice("input", input, INPUTS)
        self._input = input
        self._choice = choose_method(window)
        self._nominal = 1 / float(checks.number("sample_hz", sample_hz, positive=True))
        names = ("rate_noise", "force_noise")
        self._densities = [
            float(checks.number(*pair)) for pair in zip(names, (rate_noise, force_noise), strict=True)
        ]
        self._step = evaluator(self._choice)
        self._interpolation = evaluator(INTERPOLATION[input])
        assert self._choice.increments is not None
        self._count: int = self._choice.increments
        self.previous: int = self._choice.previous
        self.ahead: int = self._choice.ahead
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        self._stamps: list[int] = []
        self._samples: list[Array] = []

    def push(self, stamp: int, rate: Any, force: Any) -> None:
        """Take a sample.

        Parameters
        ----------
        stamp : int
            In ns: the end of the sample, or its instant. Increments and mean rates of the first sample, which has no
            stamp before it, are of no meaning.
        rate, force : array_like, (3,)
            Of the gyro and of the accelerometer, in the units of `input`, body axes.

        Raises
        ------
        PreintegrationError
            If the stamp goes back, is the last one again, or leaves a gap, or a number is not finite.
        """
        status = PreintegrationStatus
        if self._stamps:
            ahead = stamp - self._stamps[-1]
            if ahead < 0:
                raise PreintegrationError(
                    status.BACK, f"the stamp {stamp} is before the last one, {self._stamps[-1]}"
                )
            if ahead == 0:
                raise PreintegrationError(status.REPEATED, f"the stamp {stamp} is the last one again")
            if ahead * _SECOND > LONGEST * self._nominal:
                raise PreintegrationError(
                    status.GAP,
                    f"the stamp {stamp} is {ahead * _SECOND / self._nominal:.3g} nominal intervals after the last one; "
                    f"up to {LONGEST:g} are allowed",
                )
        sample = np.concatenate([np.array(part, np.float64).reshape(3) for part in (rate, force)])
        if not np.isfinite(sample).all():
            raise PreintegrationError(status.NOT_FINITE, f"the sample with the stamp {stamp} is not finite")
        if self._input == "rates":
            sample = sample * ((stamp - self._stamps[-1]) * _SECOND) if self._stamps else 0 * sample
        self._stamps.append(int(stamp))
        self._samples.append(sample)

    def between(
        self, begin: Any, end: Any, rate_bias: Any = (0.0, 0.0, 0.0), force_bias: Any = (0.0, 0.0, 0.0)
    ) -> Preintegrated:
        """Preintegrate between two instants, or between those of many intervals.

        Parameters
        ----------
        begin, end : int or array_like of int, (...)
            In ns, on the clock of the stamps.
        rate_bias, force_bias : array_like, (3,), optional
            Taken off the samples, in rad/s and m/s^2.

        Returns
        -------
        Preintegrated
            With the shape of the instants before those of its arrays.

        Raises
        ------
        PreintegrationError
            If an interval does not end after its beginning, or lies outside of the samples that it needs: those of
            `previous` of its intervals before it, and of `ahead` after it.
        """
        biases = [_vector("rate_bias", rate_bias), _vector("force_bias", force_bias)]
        first, last = np.broadcast_arrays(np.asarray(begin, np.int64), np.asarray(end, np.int64))
        shape = first.shape
        parts = [
            self._interval(int(a), int(b), np.concatenate(biases))
            for a, b in zip(first.flat, last.flat, strict=True)
        ]
        steps = np.array([len(part[0]) - self.previous - self.ahead for part in parts]) // self._count
        lengths = np.array([part[1] for part in parts])
        durations = (last.ravel() - first.ravel()) * _SECOND
        sums = self._sums(parts, steps, lengths)
        covariance, jacobian = np.empty((len(parts), 9, 9)), np.zeros((len(parts), 9, 6))
        rows, columns = np.triu_indices(9)
        covariance[:, rows, columns] = covariance[:, columns, rows] = sums[8]
        for block, (row, column) in zip(sums[3:8], ((0, 0), (3, 0), (3, 3), (6, 0), (6, 3)), strict=True):
            jacobian[:, row : row + 3, column : column + 3] = block.reshape(-1, 3, 3)
        arrays = (sums[0].reshape(-1, 3, 3), sums[1], sums[2], covariance, jacobian, durations)
        return Preintegrated(*(array.reshape(shape + array.shape[1:]) for array in arrays), *biases)

    def _interval(self, begin: int, end: int, bias: Array) -> tuple[Array, float]:
        """Return the increments that the steps of an interval take, (n, 6), and the length of one in s."""
        status = PreintegrationStatus
        if end <= begin:
            raise PreintegrationError(
                status.ORDER, f"the interval from {begin} to {end} does not end after its beginning"
            )
        duration = (end - begin) * _SECOND
        number = self._count * max(1, int(duration / (self._nominal * self._count) + 0.5))
        length = duration / number
        low, high = -self.previous, number + self.ahead
        reach = [begin + (edge * length / _SECOND) for edge in (low - POINTS, high + POINTS)]
        inside = slice(*(bisect_left(self._stamps, edge) for edge in reach))
        times = np.array([(stamp - begin) * _SECOND for stamp in self._stamps[inside]]) * (1 / length)
        if len(times) < 2 or low < times[0] - SLACK or high > times[-1] + SLACK:
            raise PreintegrationError(
                status.OUTSIDE,
                f"the interval from {begin} to {end} needs samples from {self.previous} intervals before it to "
                f"{self.ahead} after it",
            )
        boundaries = np.arange(low, high + 1).astype(np.float64)
        samples = np.array(self._samples[inside])
        if self._input == "instants":
            grid = length * resampling.interpolated(
                self._interpolation, times, samples, boundaries[:-1] + 0.5
            )
        else:
            grid = resampling.increments(self._interpolation, times, samples, boundaries)
        return grid - bias * length, length

    def _sums(self, parts: list[tuple[Array, float]], steps: Array, lengths: Array) -> list[Array]:
        """Return the sums of the kernel after the steps of every interval."""
        count = len(parts)
        signals = self._step.function.inputs[3:12]
        sums = [np.zeros((count, signal.size)) for signal in signals]
        sums[0][:] = np.eye(3).ravel()
        lengths = lengths * self._count
        noise = [np.repeat((density * density * lengths)[:, None], 3, axis=1) for density in self._densities]
        width = self.previous + self._count + self.ahead
        for step in range(int(steps.max())):
            active = np.flatnonzero(steps > step)
            row = step * self._count
            window = np.array([parts[k][0][row : row + width] for k in active])
            inputs = [
                np.ascontiguousarray(window[..., :3]).reshape(len(active), -1),
                np.ascontiguousarray(window[..., 3:]).reshape(len(active), -1),
                lengths[active, None],
                *(part[active] for part in sums),
                *(part[active] for part in noise),
            ]
            outputs, _ = self._step.run(inputs, self._step.fresh(len(active)))
            for part, output in zip(sums, outputs, strict=True):
                part[active] = output
        return sums


@cache
def _update() -> Evaluator:
    """Return the kernel of the rotation after a change of the biases."""
    return evaluator(UPDATE)


def _vector(name: str, value: Any) -> Array:
    """Return three finite numbers."""
    array = checks.real_array(name, value, (3,), np.dtype(np.float64))
    if array.shape != (3,):
        raise InputError(f"{name} has the shape {array.shape}; (3,) is needed")
    return np.asarray(array)
