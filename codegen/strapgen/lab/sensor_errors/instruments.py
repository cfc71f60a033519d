"""The errors of an inertial measurement unit as numbers in SI units: what a file of sensor errors says."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import InitVar, dataclass, field, replace
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.toml_models import Key
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.renamed import warn

Array = NDArray[np.float64]

#: Causes of errors by name, in the order of the signal: what of `InstrumentErrors` each of them has.
CAUSES: dict[str, tuple[str, ...]] = {
    "bandwidth": ("response",),
    "delay": ("delay",),
    "jitter": ("jitter",),
    "bias": ("bias",),
    "scale": ("scale_plus", "scale_minus"),
    "misalignment": ("misalignment",),
    "terms": ("terms",),
    "warm-up": ("warm_up",),
    "lock-in": ("lock_in",),
    "heating": ("heating",),
    "noise": ("noise",),
    "random walk": ("random_walk",),
    "output noise": ("output_noise",),
    "pulses": ("pulse",),
    "lost samples": ("lost", "lost_as"),
}


def zeros() -> Array:
    """Return three zeros."""
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class TriadErrors(ReadOnly):
    """Errors of three gyros, or of three accelerometers; u stands for rad, or for m/s.

    Parameters
    ----------
    bias : array, (3,)
        In u/s.
    scale_plus, scale_minus : array, (3,)
        Errors of the scale factors for increments above zero and below.
    misalignment : array, (3, 3)
        Angles in rad; row i, column j is what axis i senses of axis j. The diagonal is zero.
    terms : mapping of str to float
        Further coefficients of the kernel ``imu-errors`` by name, for instance "B_xx", in its units.
    noise : array, (3,)
        White noise of the rate (or the acceleration) in u/sqrt(s).
    random_walk : array, (3,)
        Random walk of the bias in u/s/sqrt(s).
    pulse : array, (3,)
        Quantum of the angle (or velocity) in u; 0 for none.
    lock_in : array, (3,)
        Of gyros alone, rates in rad/s below which a ring laser gives nothing; see the kernel ``lock-in-errors``.
    response : Response, or three of them
        Response of the sensors about x, y and z; its delay adds to the others.
    delay : array, (3,)
        In s.
    bandwidth_hz, damping : array, (3,)
        Old: natural frequency in Hz, infinite for none, and damping ratio of a response of second order.

    Examples
    --------
    >>> gyro = TriadErrors(bias=np.full(3, 1e-6), pulse=np.full(3, 5e-6))
    >>> gyro.bias, gyro.noise
    (array([1.e-06, 1.e-06, 1.e-06]), array([0., 0., 0.]))
    """

    bias: Array = field(default_factory=zeros)
    scale_plus: Array = field(default_factory=zeros)
    scale_minus: Array = field(default_factory=zeros)
    misalignment: Array = field(default_factory=lambda: np.zeros((3, 3)))
    terms: Mapping[str, float] = field(default_factory=dict)
    noise: Array = field(default_factory=zeros)
    random_walk: Array = field(default_factory=zeros)
    pulse: Array = field(default_factory=zeros)
    lock_in: Array = field(default_factory=zeros)
    response: Response | tuple[Response, ...] = field(default_factory=Response)
    delay: Array = field(default_factory=zeros)
    bandwidth_hz: InitVar[Any] = None
    damping: InitVar[Any] = None

    __repr__ = short_repr

    def __post_init__(self, bandwidth_hz: Any, damping: Any) -> None:
        """Put the delay of a response to the others, and one of second order in place of its numbers."""
        several = self.responses
        if bandwidth_hz is not None:
            warn("bandwidth_hz of TriadErrors", "response")
            several = second_order(bandwidth_hz, damping)
        late = np.array([float(one.delay_s) for one in several])
        object.__setattr__(self, "delay", self.delay + late)
        prompt = tuple(replace(one, delay_s=Fraction(0)) for one in several)
        object.__setattr__(self, "response", prompt[0] if len({*prompt}) == 1 else prompt)
        super().__post_init__()

    @property
    def responses(self) -> tuple[Response, ...]:
        """The responses about x, y and z."""
        return self.response if isinstance(self.response, tuple) else (self.response,) * 3


def second_order(bandwidth_hz: Any, damping: Any = None) -> tuple[Response, ...]:
    """Return responses of second order about x, y and z; one number is that of all three.

    >>> [one.words for one in second_order([80, 80, np.inf], 0.7)]
    ['second-order:80:0.7', 'second-order:80:0.7', 'increments']
    """
    numbers = (np.full(3, value, float) for value in (bandwidth_hz, 0.5**0.5 if damping is None else damping))
    return tuple(
        Response(frequency_hz=Fraction(str(hertz)), damping=Fraction(str(ratio)))
        if np.isfinite(hertz)
        else Response()
        for hertz, ratio in zip(*(one.tolist() for one in numbers), strict=True)
    )


@dataclass(frozen=True)
class Sampling:
    """Errors of the samples, which all sensors share.

    Parameters
    ----------
    jitter : float
        Standard deviation of the instant of a sample in s.
    lost : float
        Probability that a sample is lost.
    lost_as : str
        What stands in the place of a lost sample: "late" for zero, with the increment in the next one, "repeat" for the
        sample before, or "zero".

    Examples
    --------
    >>> Sampling(jitter=1e-5, lost=0.01).lost_as
    'late'
    """

    jitter: Annotated[
        float, Key("Standard deviation of the instant", "s", least=0, most=1, name="jitter_s")
    ] = 0.0
    lost: Annotated[float, Key("Probability that a sample is lost", "1", least=0, most=0.99)] = 0.0
    lost_as: Annotated[
        str,
        Key(
            "A lost sample: its increment comes late, with the next one, or repeats the one before, or is zero",
            choices=("late", "repeat", "zero"),
        ),
    ] = "late"

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class WarmUp(ReadOnly):
    """A rate that begins at switch-on, ``rate (1 - exp(-t/tau))``.

    Parameters
    ----------
    rate : array, (3,)
        Steady value in rad/s.
    tau : array, (3,)
        Time constant in s.

    Examples
    --------
    >>> WarmUp(rate=np.full(3, 1e-6), tau=np.full(3, 60.0)).tau
    array([60., 60., 60.])
    """

    rate: Array = field(default_factory=zeros)
    tau: Array = field(default_factory=lambda: np.ones(3))

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Heating(ReadOnly):
    """Scale factors of torqued gyros that change with the heat of their torquers, see ``torquer-heating-errors``.

    Parameters
    ----------
    gain : array, (3,)
        Steady deviations of the scale factors in (rad/s)^-2.
    tau : float
        Time constant in s.
    unbalance : float
        Mass unbalance of the gyros in rad/s per m/s^2.

    Examples
    --------
    >>> Heating(gain=np.full(3, 1e-5)).tau
    150.0
    """

    gain: Array = field(default_factory=zeros)
    tau: float = 150.0
    unbalance: float = 0.0

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class OutputNoise(ReadOnly):
    """Noise of an output whose sum stays bounded: ``b[n] = A b[n-1] + (1 - A)(w[n] - w[n-1])`` with white w.

    Parameters
    ----------
    decay : float
        A, from 0 to below 1.
    rms : array, (3,)
        Standard deviation of w in rad.

    Examples
    --------
    >>> OutputNoise(decay=0.9, rms=np.full(3, 1e-6)).decay
    0.9
    """

    decay: float = 0.0
    rms: Array = field(default_factory=zeros)

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class InstrumentErrors:
    """All errors of an inertial measurement unit.

    Parameters
    ----------
    title : str
    gyro, accelerometer : TriadErrors
    sampling : Sampling
    warm_up : WarmUp
    heating : Heating
    output_noise : OutputNoise
    drawn : bool
        Whether bias, scale factors, misalignments and terms are standard deviations, from which every run draws its
        values; otherwise they are the values.
    seed : int
        Of the random numbers.

    Examples
    --------
    >>> errors = InstrumentErrors(gyro=TriadErrors(bias=np.full(3, 1e-6)))
    >>> list(errors.causes), list(errors.without("bias").causes)
    (['bias'], [])
    """

    title: str = ""
    gyro: TriadErrors = TriadErrors()
    accelerometer: TriadErrors = TriadErrors()
    sampling: Sampling = Sampling()
    warm_up: WarmUp = WarmUp()
    heating: Heating = Heating()
    output_noise: OutputNoise = OutputNoise()
    drawn: bool = False
    seed: int = 1

    __repr__ = short_repr

    def without(self, *causes: str) -> InstrumentErrors:
        """Return the errors without some causes, names of `CAUSES`; the random numbers of the others stay the same.

        Examples
        --------
        >>> noisy = InstrumentErrors(gyro=TriadErrors(bias=np.ones(3), noise=np.ones(3)))
        >>> list(noisy.causes), list(noisy.without("noise").causes)
        (['bias', 'noise'], ['bias'])
        """
        errors = self
        for cause in causes:
            for name in CAUSES[cause]:
                errors = errors._reset(name)
        return errors

    def only(self, *causes: str) -> InstrumentErrors:
        """Return the errors of some causes alone."""
        return self.without(*(cause for cause in CAUSES if cause not in causes))

    def _reset(self, name: str) -> InstrumentErrors:
        """Return the errors with one number of all parts as in a perfect unit."""
        if name in ("warm_up", "heating", "output_noise"):
            return replace(self, **{name: getattr(_PERFECT, name)})
        if name in Sampling.__dataclass_fields__:
            return replace(self, sampling=replace(self.sampling, **{name: getattr(Sampling(), name)}))
        perfect = getattr(TriadErrors(), name)
        triads = {part: replace(getattr(self, part), **{name: perfect}) for part in ("gyro", "accelerometer")}
        return replace(self, **triads)

    @property
    def causes(self) -> Iterator[str]:
        """The causes of errors that are there."""
        return (cause for cause in CAUSES if self._has(cause))

    def _has(self, cause: str) -> bool:
        triads = (self.gyro, self.accelerometer)
        one_number = {
            "jitter": self.sampling.jitter > 0,
            "lost samples": self.sampling.lost > 0,
            "warm-up": bool(self.warm_up.rate.any()),
            "heating": bool(self.heating.gain.any()),
            "output noise": bool(self.output_noise.rms.any()),
            "bandwidth": any(one.changes for triad in triads for one in triad.responses),
            "terms": any(value for triad in triads for value in triad.terms.values()),
        }
        if cause in one_number:
            return one_number[cause]
        return any(getattr(triad, name).any() for triad in triads for name in CAUSES[cause])

    @property
    def needs_acceleration(self) -> bool:
        """Whether errors of the gyros depend on the specific force."""
        return any(value for name, value in self.gyro.terms.items() if name[0] in "BE") or (
            bool(self.heating.gain.any()) and self.heating.unbalance > 0
        )


_PERFECT = InstrumentErrors()


def dithered_laser_noise(lock_in_deg_s: float, dither_deg_s: float, fringes: float) -> float:
    """Return the white noise of a dithered laser gyro due to lock-in, equation (2).

    The equation is ``sigma = L / sqrt(D K)`` with the lock-in rate L in deg/h, D in rad/h and K fringes a revolution.

    Parameters
    ----------
    lock_in_deg_s : float
        Lock-in rate.
    dither_deg_s : float
        Largest rate of the dither.
    fringes : float
        Fringes of the interference pattern in a revolution.

    Returns
    -------
    float
        In rad/sqrt(s).

    Examples
    --------
    >>> round(math.degrees(dithered_laser_noise(0.03, 72, 648_000)) * 60, 8)
    0.00199471
    """
    lock_in, dither = lock_in_deg_s * 3600, math.radians(dither_deg_s) * 3600
    return math.radians(lock_in / math.sqrt(dither * fringes)) / 60


def dither_amplitude(dither_deg_s: float, frequency_hz: float, residue: float = 1.0) -> float:
    """Return the amplitude of an oscillation by its largest rate.

    Parameters
    ----------
    dither_deg_s : float
        Largest rate.
    frequency_hz : float
    residue : float, optional
        Share of the motion of the gyro's block that reaches the assembly of the sensors.

    Returns
    -------
    float
        In rad.

    Examples
    --------
    >>> round(math.degrees(dither_amplitude(72, 400)) * 3600, 4)
    103.1324
    """
    return residue * math.radians(dither_deg_s) / (2 * math.pi * frequency_hz)
