"""Predicts the error of an attitude from the errors of its sensors, in closed form along a motion.

To first order, an error delta of an increment turns the computed attitude by C delta in reference axes. The covariance
of the sum is an integral for each cause; the errors of sampled angles (pulses, jitter) add up as `quantization_noise`
derives it for a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import Choice
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.specific_forces import velocity_increments
from strapgen.lab.quantization_noise import QuantizationNoise, quantization_noise
from strapgen.lab.sensor_errors.instruments import InstrumentErrors, TriadErrors
from strapgen.lab.sensor_errors.sensors import MeasurementUnit

Array = NDArray[np.float64]

#: Most intervals of an integral along a motion.
_MOST_INTERVALS = 50_000
#: Causes whose effect is one and the same in every run, unless constants are drawn.
STEADY = ("bandwidth", "delay", "bias", "scale", "misalignment", "terms", "warm-up", "lock-in", "heating")
#: Those of them whose numbers are constants, which a run can draw.
DRAWN = ("bias", "scale", "misalignment", "terms")


@dataclass(frozen=True)
class Path:
    """A motion in so many records, each of so many intervals for integrals."""

    #: The true one
    motion: Motion
    #: The step that computes its attitude
    choice: Choice
    #: In s
    step: Fraction
    #: Steps of the run, and records after its start; they divide the steps
    steps: int
    records: int
    #: Specific force in m/s^2, constant in reference axes
    force: tuple[float, ...] = (0.0, 0.0, 0.0)

    @property
    def sampling(self) -> float:
        """Time from sample to sample in s."""
        return float(self.step) / self.choice.increments_per_step

    @cached_property
    def _parts(self) -> int:
        """Intervals of a record: all samples, or fewer that divide them nearly as finely."""
        samples = self.steps // self.records * self.choice.increments_per_step
        most = max(1, _MOST_INTERVALS // self.records)
        return samples if samples <= most else most

    @cached_property
    def interval(self) -> Fraction:
        """Length of an interval in s."""
        return self.step * self.steps / (self.records * self._parts)

    @cached_property
    def angle(self) -> Array:
        """True increments of the intervals in rad, (n, 3)."""
        return self.motion.samples(self.interval, 0, self.records * self._parts)

    @cached_property
    def velocity(self) -> Array:
        """True velocity increments of the intervals in m/s, (n, 3)."""
        return velocity_increments(self.motion.attitude, self.force, self.interval, len(self.angle))

    @cached_property
    def attitudes(self) -> Array:
        """True attitudes in the middle of the intervals, (n, 3, 3)."""
        middles = (np.arange(len(self.angle)) + 0.5) * float(self.interval)
        return self.motion.attitude(middles)

    @cached_property
    def ends(self) -> Array:
        """True attitudes at the records, (records, 3, 3)."""
        times = np.arange(1, self.records + 1) * float(self.step * self.steps) / self.records
        return self.motion.attitude(times)

    @cached_property
    def rates(self) -> Array:
        """Mean rates of the last interval before each record in rad/s, (records, 3)."""
        last: Array = self.angle[self._parts - 1 :: self._parts] / float(self.interval)
        return last

    def summed(self, terms: Array) -> Array:
        """Return the sums of terms of all intervals, (n, ...), up to each record, (records, ...)."""
        of_records = terms.reshape(self.records, self._parts, *terms.shape[1:]).sum(axis=1)
        sums: Array = np.cumsum(of_records, axis=0)
        return sums

    @cached_property
    def noise(self) -> QuantizationNoise:
        """The noise of sampled angles, accumulated in a run of the step."""
        return quantization_noise(self.choice)


def error_mean(path: Path, errors: InstrumentErrors) -> Array:
    """Return the error of the attitude that all runs have in common, to first order.

    Returns (records, 3): in rad, reference axes; what leads is positive.
    """
    common = errors.only(*(cause for cause in STEADY if not (errors.drawn and cause in DRAWN)))
    return _effect(path, common) - _mean_loss(path, errors)


def covariances(path: Path, errors: InstrumentErrors) -> dict[str, Array]:
    """Return the covariance of the error of the attitude by cause, to first order.

    Returns (records, 3, 3): in rad^2, reference axes; zero for a cause that is the same in every run.

    White noise N leaves N sqrt(t) on every axis, on any motion:

    >>> from strapgen import choose, motion
    >>> from strapgen.lab.sensor_errors.instruments import TriadErrors
    >>> cone = motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    >>> path = Path(cone, choose("euler", "rk4", 2), Fraction(1, 10), 400, 1)
    >>> noisy = InstrumentErrors(gyro=TriadErrors(noise=np.full(3, 1e-3)))
    >>> np.sqrt(np.diagonal(covariances(path, noisy)["noise"][-1])).round(7)
    array([0.0063246, 0.0063246, 0.0063246])
    """
    forms: dict[str, Callable[[Path, InstrumentErrors], Array]] = {
        "noise": _of_noise,
        "random walk": _of_walk,
        "output noise": _of_output_noise,
        "pulses": _of_pulses,
        "jitter": _of_jitter,
        "lost samples": _of_losses,
    }
    nothing = np.zeros((path.records, 3, 3))
    result = {}
    for cause in errors.causes:
        if cause in forms:
            result[cause] = forms[cause](path, errors)
        elif errors.drawn and cause in DRAWN:
            result[cause] = _of_constants(path, errors.only(cause))
        else:
            result[cause] = nothing
    return result


def _rotate(attitudes: Array, variances: Array) -> Array:
    """Return C diag(v) C^T of variances on body axes, (3,), for many attitudes."""
    result: Array = np.einsum("nij,j,nkj->nik", attitudes, variances, attitudes)
    return result


def _across(path: Path) -> Array:
    """Return C [d x] of the increments d of all intervals, (n, 3, 3)."""
    cross = np.zeros((len(path.angle), 3, 3))
    for row, column, axis, sign in ((0, 1, 2, -1), (0, 2, 1, 1), (1, 2, 0, -1)):
        cross[:, row, column] = sign * path.angle[:, axis]
        cross[:, column, row] = -sign * path.angle[:, axis]
    result: Array = path.attitudes @ cross
    return result


def _effect(path: Path, errors: InstrumentErrors) -> Array:
    """Return the error of the attitude by errors without random numbers, (records, 3)."""
    angle, _ = MeasurementUnit(replace(errors, drawn=False), float(path.interval))(path.angle, path.velocity)
    return path.summed(np.einsum("nij,nj->ni", path.attitudes, angle - path.angle))


def _of_noise(path: Path, errors: InstrumentErrors) -> Array:
    """White noise: the integral of C diag(N^2) C^T."""
    return path.summed(_rotate(path.attitudes, errors.gyro.noise**2)) * float(path.interval)


def _of_walk(path: Path, errors: InstrumentErrors) -> Array:
    """Random walk of the bias: K^2 times the integral of (S(t) - S(s))^2 over s, where S is the integral of C."""
    length, total = float(path.interval), np.zeros((path.records, 3, 3))
    time = path.summed(np.full(len(path.angle), length))[:, None, None]
    for axis, strength in enumerate(errors.gyro.random_walk):
        steps = path.attitudes[:, :, axis] * length
        middle = np.cumsum(steps, axis=0) - steps / 2
        at_end = path.summed(steps)
        once = path.summed(middle) * length
        twice = path.summed(_outer(middle, middle)) * length
        mixed = _outer(at_end, once)
        spread = time * _outer(at_end, at_end) - mixed - np.swapaxes(mixed, 1, 2) + twice
        total += strength**2 * spread
    return total


def _outer(one: Array, other: Array) -> Array:
    return one[:, :, None] * other[:, None, :]


def _of_output_noise(path: Path, errors: InstrumentErrors) -> Array:
    """Noise with a bounded sum: the sum at the end, and what the rotation in the meantime makes of it."""
    decay, rms = errors.output_noise.decay, errors.output_noise.rms
    bounded = (1 - decay) / (1 + decay)
    # Of the spectrum of the sum, 1 at frequency zero, a step takes in addition what lies at half of its samples' rate.
    beside = path.choice.increments_per_step * float(path.noise.turning) - 1
    factor = (1 + beside * bounded**2) * path.sampling / float(path.interval)
    return bounded * _rotate(path.ends, rms**2) + factor * path.summed(_rotate(_across(path), rms**2))


def _of_pulses(path: Path, errors: InstrumentErrors) -> Array:
    """Pulses: independent errors of q^2/12 of all sampled angles, that at the start among them."""
    variances, noise = errors.gyro.pulse**2 / 12, path.noise
    once = float(noise.end) * _rotate(path.ends, variances) + float(noise.start) * np.diag(variances)
    steps = path.steps // path.records * np.arange(1, path.records + 1)
    walk = float(noise.walk) * steps[:, None, None] * np.diag(variances)
    factor = float(noise.turning) * float(path.step) / float(path.interval)
    return once + walk + factor * path.summed(_rotate(_across(path), variances))


def _of_jitter(path: Path, errors: InstrumentErrors) -> Array:
    """Jitter: the angle at the end is that of another instant; what lies before is made good by the next sample."""
    along = np.einsum("nij,nj->ni", path.ends, path.rates)
    return float(path.noise.end) * errors.sampling.jitter**2 * _outer(along, along)


def _of_losses(path: Path, errors: InstrumentErrors) -> Array:
    """Lost samples: what is missing adds up, unless the next sample brings it.

    The number L of samples that are lost one after the other up to an instant has the mean p/(1-p) and the variance
    p/(1-p)^2; it is a recursion L' = (L + 1) times 0 or 1, whose sum has (1+p)/(1-p) times the variance of independent
    numbers.
    """
    chance = errors.sampling.lost
    variance = {
        "late": chance / (1 - chance) ** 2,
        "repeat": chance * (1 + chance) / (1 - chance) ** 3,
        "zero": chance * (1 - chance),
    }[errors.sampling.lost_as]
    along, ratio = _missing(path, errors), path.sampling / float(path.interval)
    if errors.sampling.lost_as == "late":
        return variance * _outer(along, along)
    return variance * path.summed(_outer(along, along)) * ratio


def _mean_loss(path: Path, errors: InstrumentErrors) -> Array:
    """Return the mean angle of lost samples, (records, 3) in rad, reference axes."""
    chance, lost_as = errors.sampling.lost, errors.sampling.lost_as
    share = chance if lost_as == "zero" else chance / (1 - chance)
    along = _missing(path, errors)
    return share * (along if lost_as == "late" else path.summed(along))


def _missing(path: Path, errors: InstrumentErrors) -> Array:
    """Return what one lost sample lacks, at the records if the next one brings it, else in all intervals."""
    if errors.sampling.lost_as == "late":
        at_end: Array = np.einsum("nij,nj->ni", path.ends, path.rates) * path.sampling
        return at_end
    missing = path.angle
    if errors.sampling.lost_as == "repeat":
        ratio = path.sampling / float(path.interval)
        missing = np.diff(path.angle, axis=0, prepend=path.angle[:1]) * ratio
    turned: Array = np.einsum("nij,nj->ni", path.attitudes, missing)
    return turned


def _of_constants(path: Path, errors: InstrumentErrors) -> Array:
    """Constants that every run draws: the square of what each of them does at its standard deviation."""
    total = np.zeros((path.records, 3, 3))
    for one in single_constants(errors.gyro):
        effect = _effect(path, replace(errors, gyro=one, accelerometer=TriadErrors()))
        total += _outer(effect, effect)
    return total


def single_units(errors: InstrumentErrors) -> list[InstrumentErrors]:
    """Return units that have each constant of both triads alone."""
    nothing = replace(errors, gyro=TriadErrors(), accelerometer=TriadErrors(), drawn=False)
    gyros = [replace(nothing, gyro=one) for one in single_constants(errors.gyro)]
    return gyros + [replace(nothing, accelerometer=one) for one in single_constants(errors.accelerometer)]


def single_constants(triad: TriadErrors) -> list[TriadErrors]:
    """Return the errors of each constant alone."""
    singles: list[TriadErrors] = []

    def add(**changes: Any) -> None:
        singles.append(replace(TriadErrors(), **changes))

    for axis in range(3):
        unit = np.eye(3)[axis]
        if triad.bias[axis]:
            add(bias=unit * triad.bias)
        plus, minus = unit * triad.scale_plus, unit * triad.scale_minus
        if (plus == minus).all() and plus.any():
            add(scale_plus=plus, scale_minus=minus)
        else:
            for name, value in (("scale_plus", plus), ("scale_minus", minus)):
                if value.any():
                    add(**{name: value})
    for place in np.argwhere(triad.misalignment):
        matrix = np.zeros((3, 3))
        matrix[tuple(place)] = triad.misalignment[tuple(place)]
        add(misalignment=matrix)
    for name, value in triad.terms.items():
        if value:
            add(terms={name: value})
    return singles
