"""The gyro between motion and algorithm: increments as whole numbers of pulses, increments kept for later steps."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import checks
from strapgen.exceptions import InputError

#: The longest run of pulses that is counted: doubles hold every whole number up to here.
_MOST_PULSES = 2**53


def windows(increments: Any, count: int, previous: int = 0) -> NDArray[np.float64]:
    """Cut increments in a row into what each step takes.

    Parameters
    ----------
    increments : array_like, (previous + N count, 3)
        Angle increments in rad, body axes.
    count : int
        Increments that belong to a step.
    previous : int, optional
        Increments before the step that it takes too.

    Returns
    -------
    array, (N, previous + count, 3)

    Examples
    --------
    >>> windows(np.arange(15.0).reshape(5, 3), 2, previous=1)[:, :, 0]
    array([[ 0.,  3.,  6.],
           [ 6.,  9., 12.]])
    """
    row = np.ascontiguousarray(increments, np.float64)
    checks.count("count", count)
    checks.count("previous", previous, smallest=0)
    if row.ndim != 2 or row.shape[1] != 3 or (len(row) - previous) % count or len(row) < previous:
        raise InputError(
            f"increments has shape {row.shape}; ({previous} + a multiple of {count}, 3) is needed for whole steps"
        )
    if not previous:
        return row.reshape(-1, count, 3)
    if len(row) < previous + count:
        return np.empty((0, previous + count, 3))
    overlapping = np.lib.stride_tricks.sliding_window_view(row, previous + count, axis=0)[::count]
    return np.ascontiguousarray(np.moveaxis(overlapping, -1, 1))


def pulses(increments: Any, size: float | str | Fraction, previous: int = 0) -> NDArray[np.float64]:
    """Return increments as a gyro that counts pulses gives them: what makes no whole pulse is carried on.

    The angle since the start is rounded to the nearest pulse, and differences are taken: no angle is ever lost, each
    sum of increments is off by at most a pulse.

    Parameters
    ----------
    increments : array_like, (..., N, K, 3)
        Angle increments of N steps in rad, body axes; leading axes are independent runs.
    size : number
        Angle of a pulse in rad.
    previous : int, optional
        How many of the K increments of a step are those before it, which `windows` repeats.

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
    if previous and d.ndim > 3 and d.size:
        return np.stack([pulses(run, size, previous) for run in d])
    if previous and d.size:
        row = np.concatenate([d[0, :previous], d[:, previous:].reshape(-1, 3)])
        return windows(pulses(row[:, None], size)[:, 0], d.shape[1] - previous, previous)
    flat = d.reshape(*d.shape[:-3], -1, 3)
    angle = np.cumsum(flat, axis=-2) / pulse
    if not np.abs(angle).max(initial=0.0) < _MOST_PULSES:
        raise InputError(f"pulse is {pulse:g} rad; the run would take more pulses than can be counted")
    counts = np.diff(np.rint(angle), axis=-2, prepend=0.0)
    return (counts * pulse).reshape(d.shape)
