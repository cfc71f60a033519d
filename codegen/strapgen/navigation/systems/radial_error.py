"""The radial error rate that 95 of 100 flights stay below, from their errors of position and their times."""

from __future__ import annotations

import math
from collections.abc import Sequence

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: The factor as printed, and that of Rayleigh's distribution, sqrt(-2 ln 0.05).
PRINTED, RAYLEIGH = 2.45, math.sqrt(-2 * math.log(0.05))


def radial_error_rate(errors: Sequence[float], times: Sequence[float], factor: float = PRINTED) -> float:
    """Return R95 = 2.45 sqrt(sum (RPE/T)^2/(2 n)), whose radicand the scan lost.

    Where north and east errors of a rate are normal with one deviation s, n flights estimate s^2 by the sum over 2 n,
    and 95 % of the radial errors are below 2.447747 s.

    >>> round(radial_error_rate([1.0, 2.0, 3.0], [1.0, 2.0, 1.0]), 6)
    3.317316
    """
    distances, durations = checks.numbers("errors", errors), checks.numbers("times", times)
    if distances.shape != durations.shape or distances.ndim != 1 or not distances.size:
        raise InputError(
            f"errors are {distances.size} and times {durations.size}; one of each for a flight is needed"
        )
    if not (durations > 0).all():
        raise InputError(
            "a time is not above 0; the rate of an error is its size over the time of its flight"
        )
    return float(factor * math.sqrt(((distances / durations) ** 2).sum() / (2 * distances.size)))
