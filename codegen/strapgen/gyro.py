"""The gyro as a stage between motion and algorithm: angle increments as whole numbers of pulses."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import checks
from strapgen.exceptions import InputError

#: The longest run of pulses that is counted: doubles hold every whole number up to here.
_MOST_PULSES = 2**53


def pulses(increments: Any, size: float | str | Fraction) -> NDArray[np.float64]:
    """Return increments as a gyro that counts pulses gives them: what makes no whole pulse is carried on.

    The angle since the start is rounded to the nearest pulse, and differences are taken: no angle is ever lost, each
    sum of increments is off by at most a pulse.

    Parameters
    ----------
    increments : array_like, (..., N, K, 3)
        Angle increments of N steps in rad, body axes; leading axes are independent runs.
    size : number
        Angle of a pulse in rad.

    Returns
    -------
    array, (..., N, K, 3)
        Whole multiples of the pulse, in rad.

    Raises
    ------
    InputError
        If the size is no number above 0, or the angle takes more pulses than can be counted.

    Examples
    --------
    >>> pulses(np.full((4, 1, 3), 0.4), 1)[:, 0, 0]
    array([0., 1., 0., 1.])
    """
    pulse = float(checks.number("pulse", size, positive=True))
    d = np.asarray(increments, np.float64)
    flat = d.reshape(*d.shape[:-3], -1, 3)
    angle = np.cumsum(flat, axis=-2) / pulse
    if not np.abs(angle).max(initial=0.0) < _MOST_PULSES:
        raise InputError(f"pulse is {pulse:g} rad; the run would take more pulses than can be counted")
    counts = np.diff(np.rint(angle), axis=-2, prepend=0.0)
    return (counts * pulse).reshape(d.shape)
