"""What the first-order attitude in a slow cycle, equation (47), costs in velocity: exact series and closed form.

At a constant rate w and acceleration a across it, over a cycle T, with the angle phi = |w| T, A(t) = I + [beta x] makes
the velocity increment too large by 1 - sin(phi)/phi of itself along a, and by phi/2 - (1 - cos(phi))/phi across a and
w. The leading term of what is missing is (T^3/6) w x (w x a).
"""

from __future__ import annotations

import math
from fractions import Fraction

from strapgen.ir.exceptions import InputError

#: Below this angle in rad the closed forms lose digits, and their series has these.
_SMALL = 0.5
_TERMS = 12


def along_series(terms: int) -> dict[int, Fraction]:
    """Return the series of the error along the acceleration, by powers of phi.

    >>> along_series(2)
    {2: Fraction(1, 6), 4: Fraction(-1, 120)}
    """
    return {2 * k: Fraction((-1) ** (k + 1), math.factorial(2 * k + 1)) for k in range(1, terms + 1)}


def across_series(terms: int) -> dict[int, Fraction]:
    """Return the series of the error across acceleration and rate, as `along_series`.

    >>> across_series(2)
    {3: Fraction(1, 24), 5: Fraction(-1, 720)}
    """
    return {2 * k + 1: Fraction((-1) ** (k + 1), math.factorial(2 * k + 2)) for k in range(1, terms + 1)}


def errors(phi: float) -> tuple[float, float]:
    """Return the errors along and across the acceleration, as parts of the velocity increment.

    `phi`: angle of the cycle in rad.

    >>> print("{:.9e} {:.6e}".format(*errors(0.1)))
    1.665833532e-03 4.165278e-05
    """
    if abs(phi) < _SMALL:
        along, across = (
            math.fsum(float(c) * phi**power for power, c in series(_TERMS).items())
            for series in (along_series, across_series)
        )
        return along, across
    return 1 - math.sin(phi) / phi, phi / 2 - (1 - math.cos(phi)) / phi


def slowest_rate(largest_rate: float, error: float) -> float:
    """Return the slow rate at which the error is as stated at the largest rate.

    `largest_rate`: in rad/s. Returned in Hz.

    >>> round(slowest_rate(1.0, 1e-4), 4)
    40.8246
    """
    if not 0 < error < 1:
        raise InputError(
            f"velocity-error is {error:g}; a part of the increment, above 0 and below 1, is needed"
        )
    if not 0 < largest_rate < math.inf:
        raise InputError(f"largest rate is {largest_rate:g}; a number above 0 is needed")
    low, high = 0.0, math.pi
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if math.hypot(*errors(middle)) < error else (low, middle)
    return largest_rate / high
