"""Computes mean rates as functions of frequency, at constant amplitudes."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen.analysis.vibration.mean_rates import Assessment
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

Array = NDArray[np.float64]

#: Default number of frequencies of a curve.
POINTS = 400


@dataclass(frozen=True)
class Curve:
    """The mean rates of an algorithm as functions of frequency."""

    #: Name of the kernel
    label: str
    #: "rad/s" or "m/s^2"
    unit: str
    #: (N,)
    frequencies_hz: Array
    #: (N,): the true rate, and the error of the algorithm, in that unit
    continuous: Array
    error: Array


def frequencies(low: float | str | Fraction, high: float | str | Fraction, points: int = POINTS) -> Array:
    """Return frequencies in Hz at equal ratios from one end to the other.

    `low, high`: ends in Hz, above 0. Returns (points,).

    >>> frequencies(1, 100, 3)
    array([  1.,  10., 100.])
    """
    first, last = (float(checks.number("frequency", end, positive=True)) for end in (low, high))
    if not first < last:
        raise InputError(f"frequencies {low} to {high} Hz do not rise")
    hertz: Array = np.geomspace(first, last, points)
    return hertz


def curve(
    assessment: Assessment,
    hertz: Array,
    step: float | str | Fraction,
    *,
    theta_x: float | str | Fraction,
    theta_y: float | str | Fraction = 0,
    phase: float | str | Fraction = 0,
    acceleration_y: float | str | Fraction = 0,
    cycles: int | None = None,
) -> Curve:
    """Return the rates of an algorithm for the vibration of equation (65) or (70), at many frequencies.

    `hertz` (N,): frequencies in Hz, above 0.
    """
    amplitude_x, amplitude_y, angle, amplitude = (
        float(checks.number(what, value))
        for what, value in (
            ("theta-x-rad", theta_x),
            ("theta-y-rad", theta_y),
            ("phase-rad", phase),
            ("acceleration-y", acceleration_y),
        )
    )
    shift = np.exp(1j * angle)
    amplitudes = {
        "angle_x": amplitude_x + 0 * hertz,
        "angle_y": amplitude_y * shift + 0 * hertz,
        "velocity_y": amplitude * shift / (2j * np.pi * hertz),
    }
    rates = {}
    for part in ("continuous", "error"):
        rates[part] = np.zeros(len(hertz))
        for (first, second), factor in assessment.factors(part, hertz, step, cycles).items():
            if first in amplitudes and second in amplitudes:
                with np.errstate(all="ignore"):
                    rates[part] += (factor * amplitudes[first] * np.conj(amplitudes[second])).real
                if not np.isfinite(rates[part][np.isfinite(factor)]).all():
                    raise InputError(
                        f"{assessment.kernel}: the rates of the curve are beyond the range of double"
                    )
    return Curve(assessment.kernel, assessment.unit, hertz, rates["continuous"], rates["error"])
