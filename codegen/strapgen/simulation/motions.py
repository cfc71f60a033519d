"""A `Motion` has exact increments for an algorithm, and the true attitude to compare its result with.

The formulas are kernels of the catalogue; the generated numpy code of the kernels evaluates them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.backends import evaluator
from strapgen.backends.increments import windows
from strapgen.support import checks
from strapgen.support.exceptions import InputError

Array = NDArray[np.float64]

#: Motions whose parameters are zero by default, as long as one of them is set.
_MAY_BE_LEFT_OUT = ("constant", "polynomial")


def keys(name: str) -> dict[str, dict[str, float]]:
    """Return, for every parameter of a motion, the keys that set it and the factor of each to SI units.

    Parameters
    ----------
    name : str
        Name of the motion.

    Returns
    -------
    dict of str to dict of str to float

    Raises
    ------
    InputError
        If the motion is unknown.

    Examples
    --------
    >>> sorted(keys("sinusoidal")["b"])
    ['b_deg_s', 'b_rad_s']
    """
    parameters = catalogue.MOTIONS[checks.choice("motion", name, catalogue.MOTIONS)]
    degree = math.radians(1)
    if name == "polynomial":
        return {parameter: {parameter: degree} for parameter in parameters}
    return {p: {f"{p}_deg_s": degree, f"{p}_rad_s": 1.0} for p in parameters}


@dataclass(frozen=True)
class Motion:
    """A motion of the catalogue with numbers for its parameters.

    Parameters
    ----------
    name : str
        Name of the motion.
    parameters : dict of str to float
        Its parameters in SI units.
    """

    name: str
    parameters: dict[str, float]

    def increments(
        self, step: Fraction, steps: int, samples: int, previous: int = 0, ahead: int = 0
    ) -> Array:
        """Return the exact angle increments.

        Parameters
        ----------
        step : Fraction
            Step length in s.
        steps : int
            Number of steps from t = 0.
        samples : int
            Increments per step.
        previous, ahead : int, optional
            Increments from before each step and from after it that it takes in addition; those before the first step
            lie before t = 0.

        Returns
        -------
        array, (steps, previous + samples + ahead, 3)
            Integrals of the body rate in rad, body axes.
        """
        row = self.samples(step / samples, -previous, steps * samples + ahead)
        return windows(row, samples, previous + ahead)

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


def motion(name: str, /, **settings: float | str | Fraction) -> Motion:
    """Return a motion with a closed-form attitude.

    Parameters
    ----------
    name : str
        "constant" (keys x, y, z), "sinusoidal" (a, b) or "coning" (a, b, g), whose keys end with a unit, as in
        ``a_deg_s`` or ``a_rad_s``; or "polynomial" (a0, ..., a4, in deg/s^(k+1)). For "constant" and
        "polynomial" missing parameters are zero, but one is needed.
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
    known = keys(name)
    allowed = [key for choices in known.values() for key in choices]
    for key in settings:
        checks.choice(f"key of motion {name}:", key, allowed)
    if not settings:
        raise InputError(f"motion {name} needs parameters; allowed: {', '.join(allowed)}")
    parameters: dict[str, float] = {}
    for parameter, choices in known.items():
        used = [key for key in choices if key in settings]
        if len(used) > 1:
            raise InputError(f"motion {name}: {' and '.join(used)} are both given; one is needed")
        if not used and name not in _MAY_BE_LEFT_OUT:
            raise InputError(f"motion {name} lacks {' or '.join(choices)}")
        parameters[parameter] = 0.0
        for key in used:
            parameters[parameter] = float(checks.number(key, settings[key])) * choices[key]
    return Motion(name, parameters)


#: A motion whose rate changes direction and size, of about 1 rad/s: settings of coning.
GENERAL = {"a_rad_s": "1", "b_rad_s": "1.5", "g_rad_s": "0.6"}
