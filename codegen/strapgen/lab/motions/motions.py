"""A `Motion` has exact increments for an algorithm, and the true attitude to compare its result with.

The formulas are kernels of the catalogue; the generated numpy code of the kernels evaluates them. An attitude without
a closed form is integrated, see `reference_attitudes`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from strapgen import registration
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.renamed import renamed_parameters
from strapgen.lab.motions.motion_names import MOTIONS, MotionEntry
from strapgen.lab.motions.motion_names import parameters as settings_of
from strapgen.lab.motions.rate_profiles import RateProfile, ReferenceAttitude
from strapgen.registry import Titles
from strapgen.run.backends import evaluator
from strapgen.run.increments import windows

Array = NDArray[np.float64]

#: Endings of the keys of a parameter by its unit, and the factor of each to SI units.
_ENDINGS = {
    "rad/s": {"deg_s": math.radians(1), "rad_s": 1.0},
    "rad": {"deg": math.radians(1), "rad": 1.0},
    "s": {"s": 1.0},
    "Hz": {"hz": 1.0},
    "m": {"m": 1.0},
    "m/s": {"m_s": 1.0},
}


def keys(name: str) -> dict[str, dict[str, float]]:
    """Return, for every parameter of a motion, the keys that set it and the factor of each to SI units.

    >>> sorted(keys("sinusoidal")["b"])
    ['b_deg_s', 'b_rad_s']
    """
    parameters = MOTIONS[checks.choice("motion", name, MOTIONS)].parameters
    if name == "polynomial":
        return {parameter: {parameter: math.radians(1)} for parameter in parameters}
    for parameter, unit in parameters.items():
        if unit not in _ENDINGS:
            raise InputError(
                f"motion {name}: unit of {parameter} is {unit!r}; allowed: {', '.join(_ENDINGS)}"
            )
    return {
        p: {f"{p}_{ending}": factor for ending, factor in _ENDINGS[unit].items()}
        for p, unit in parameters.items()
    }


def titles() -> dict[str, str]:
    """Return the motions by name, with the keys that set their parameters."""

    def line(name: str, entry: MotionEntry) -> str:
        return ", ".join(" or ".join(choices) for choices in keys(name).values())

    return {**Titles(MOTIONS, line), **MOTIONS.taken()}


@dataclass(frozen=True)
class Motion(ReadOnly):
    """A motion of the catalogue with numbers for its parameters.

    Parameters
    ----------
    name : str
        Name of the motion.
    parameters : dict of str to float
        Its parameters in SI units.

    Examples
    --------
    >>> motion("constant", z_deg_s=90).attitude(1.0).round(3) + 0.0
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """

    name: str
    parameters: Mapping[str, float]

    __repr__ = short_repr

    @renamed_parameters(samples="increments")
    def increments(
        self, step: Fraction, steps: int, increments: int, previous: int = 0, ahead: int = 0
    ) -> Array:
        """Return the exact angle increments.

        Parameters
        ----------
        step : Fraction
            Step length in s.
        steps : int
            Number of steps from t = 0.
        increments : int
            Increments per step.
        previous, ahead : int, optional
            Increments from before each step and from after it that it takes in addition; those before the first step
            lie before t = 0.

        Returns
        -------
        array, (steps, previous + increments + ahead, 3)
            Integrals of the body rate in rad, body axes.
        """
        row = self.samples(step / increments, -previous, steps * increments + ahead)
        return windows(row, increments, previous + ahead)

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return exact angle increments of some sampling intervals.

        Parameters
        ----------
        interval : Fraction
            Sampling interval in s.
        first, stop : int
            Numbers of the first interval and of the one after the last; number 0 begins at t = 0.

        Returns
        -------
        array, (stop - first, 3)
            Integrals of the body rate in rad, body axes.
        """
        middles = (2 * np.arange(first, stop) + 1) * float(interval / 2)
        values: Array = evaluator(f"{self.name}-increments")(
            middles, float(interval), *self.parameters.values()
        )
        return values

    def attitude(self, time: Any) -> Array:
        """Return the true attitude.

        Parameters
        ----------
        time : array_like, (...)
            Times in s.

        Returns
        -------
        array, (..., 3, 3)
            Direction cosine matrices, body to reference; the identity at time 0.

        Examples
        --------
        >>> motion("constant", z_deg_s=90).attitude(1.0).round(12) + 0.0
        array([[ 0., -1.,  0.],
               [ 1.,  0.,  0.],
               [ 0.,  0.,  1.]])
        """
        return self._truth(time)[1]

    def rate(self, time: Any) -> Array:
        """Return the body rate.

        Parameters
        ----------
        time : array_like, (...)
            Times in s.

        Returns
        -------
        array, (..., 3)
            Rates in rad/s, body axes.
        """
        return self._truth(time)[0]

    def _truth(self, time: Any) -> tuple[Array, Array]:
        times = np.asarray(time, float)
        result: tuple[Array, Array] = evaluator(f"{self.name}-truth")(times, *self.parameters.values())
        return result


@runtime_checkable
class InertialMotion(Protocol):
    """A motion with a specific force of its own."""

    def both_samples(self, interval: Fraction, first: int, stop: int) -> tuple[Array, Array]:
        """Return angle increments in rad and velocity increments in m/s, body axes, as `Motion.samples` does."""


@dataclass(frozen=True)
class IntegratedMotion(Motion):
    """A motion whose increments are exact, and whose attitude is integrated.

    `parameters`: its parameters in SI units.
    """

    @cached_property
    def profile(self) -> RateProfile:
        """Its rate, and the integral of it."""
        made = _made(self.name, self.parameters)
        assert isinstance(made, RateProfile), "`motion` makes no other"
        return made

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return exact angle increments of some sampling intervals, see `Motion.samples`."""
        edges = np.arange(first, stop + 1) * float(interval)
        increments: Array = np.diff(self.profile.angle(edges), axis=0)
        return increments

    def attitude(self, time: Any) -> Array:
        """Return the true attitude, see `Motion.attitude`; no time may be below 0."""
        return _reference(self.name, tuple(self.parameters.items()))(time)

    def rate(self, time: Any) -> Array:
        """Return the body rate, see `Motion.rate`."""
        return self.profile.rate(time)


@lru_cache(maxsize=16)
def _reference(name: str, parameters: tuple[tuple[str, float], ...]) -> ReferenceAttitude:
    """Return the attitude of a motion, which all runs on it share."""
    profile = IntegratedMotion(name, dict(parameters)).profile
    return ReferenceAttitude(profile.rate, profile.substeps)


def _made(name: str, parameters: Mapping[str, float]) -> Motion | RateProfile:
    """Return the motion of a function and its parameters, or refuse parameters out of range."""
    with MOTIONS.guarded(name, "define a motion"):
        made = registration.load(MOTIONS[name].function)(**parameters)
    if not isinstance(made, Motion | RateProfile):
        raise InputError(
            f"motion {name} ({MOTIONS[name].function}) returned {type(made).__name__}; a Motion, or a profile "
            "with rate, angle and substeps is needed"
        )
    return made


def cone(half_angle: float, frequency: float, spin: float) -> Motion:
    """Return the coning motion whose axis y goes round a cone while the body spins about it."""
    # Round the cone's axis y turns at b + spin; a and b + g are the components of that rate across y and along it.
    turning = 2 * math.pi * frequency
    across, along = turning * math.sin(half_angle), -2 * turning * math.sin(half_angle / 2) ** 2
    return Motion("coning", {"a": across, "b": turning - spin, "g": along + spin})


def motion(name: str, /, **settings: float | str | Fraction) -> Motion:
    """Return a motion with a known attitude.

    Parameters
    ----------
    name : str
        "constant" (keys x, y, z), "sinusoidal" (a, b), "coning" (a, b, g), "cone" (half_angle, frequency, spin),
        "random" (rate), "slew" and "ramps" (onset, rate) or "vibration" (angle, gyro), whose keys end with a unit, as
        in ``a_deg_s`` or ``a_rad_s``; or "polynomial" (a0, ..., a4, in deg/s^(k+1)). A spin and the parameters of
        "constant" and "polynomial" are zero by default, a rate of slews is 300 deg/s, and a gyro passes on everything;
        one parameter is needed.
    **settings : number
        The parameters.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        If the motion or a key is unknown, a parameter is missing or set twice, or a number is not finite.

    Examples
    --------
    >>> motion("coning", a_deg_s=10, b_rad_s=0.5, g_deg_s=0).parameters["b"]
    0.5
    """
    known, entry = keys(name), MOTIONS[name]
    if settings or not entry.complete:
        try:
            parameters = settings_of(f"motion {name}", known, settings, entry.defaults)
        except InputError as error:
            error.in_file = True  # its names are keys, not options
            raise
    else:
        parameters = dict(entry.defaults)
    if not MOTIONS[name].function:
        return Motion(name, parameters)
    made = _made(name, parameters)
    return made if isinstance(made, Motion) else IntegratedMotion(name, parameters)


#: A motion whose rate changes direction and size, of about 1 rad/s: settings of coning.
GENERAL = {"a_rad_s": "1", "b_rad_s": "1.5", "g_rad_s": "0.6"}
