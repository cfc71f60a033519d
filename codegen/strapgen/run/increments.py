"""Prepares gyro increments for an algorithm: `pulses` quantizes them, `windows` cuts them into those of each step.

>>> from strapgen import gyro
>>> gyro.pulses(np.full((1, 2, 3), 2.6e-5), 1e-5)[0, :, 0]  # of 1e-5 rad; what remains goes on
array([3.e-05, 2.e-05])
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.renamed import renamed_parameters

#: Most pulses that can be counted, since a double represents every whole number up to here.
_MOST_PULSES = 2**53
#: Most steps of a run that are propagated together where their increments come part by part.
PART = 128_000


@renamed_parameters(increments="samples")
def windows(samples: Any, count: int, beside: int = 0) -> NDArray[np.float64]:
    """Cut a row of increments into the increments of each step.

    Parameters
    ----------
    samples : array_like, (beside + N count, 3)
        Angle increments in rad, body axes.
    count : int
        Increments per step.
    beside : int, optional
        Increments from before each step and from after it that it takes in addition.

    Returns
    -------
    array, (N, beside + count, 3)
        Angle increments in rad, body axes, oldest first.

    Raises
    ------
    InputError, InputTypeError
        If a number is not allowed, or the row holds no numbers or does not consist of whole steps.

    Examples
    --------
    >>> windows(np.arange(15.0).reshape(5, 3), 2, beside=1)[:, :, 0]
    array([[ 0.,  3.,  6.],
           [ 6.,  9., 12.]])
    """
    row = np.ascontiguousarray(checks.numbers("samples", samples))
    count = checks.count("count", count)
    beside = checks.count("beside", beside, smallest=0)
    if row.ndim != 2 or row.shape[1] != 3 or (len(row) - beside) % count or len(row) < beside:
        raise InputError(
            f"samples has shape {row.shape}; ({beside} + a multiple of {count}, 3) is needed for whole steps"
        )
    if not beside:
        return row.reshape(-1, count, 3)
    if len(row) < beside + count:
        return np.empty((0, beside + count, 3))
    overlapping = np.lib.stride_tricks.sliding_window_view(row, beside + count, axis=0)[::count]
    return np.ascontiguousarray(np.moveaxis(overlapping, -1, 1))


@renamed_parameters(increments="samples")
@np.errstate(all="ignore")  # angles that overflow are refused, in one line
def pulses(samples: Any, size: float | str | Fraction, beside: int = 0) -> NDArray[np.float64]:
    """Return increments as a gyro that counts pulses measures them.

    The angle since the start is rounded to the nearest pulse, and each increment is a difference of rounded angles.
    Fractions of a pulse are thus carried on, and the error of a sum of increments is at most one pulse.

    Parameters
    ----------
    samples : array_like, (..., N, K, 3)
        Angle increments of N steps in rad, body axes; leading axes are independent runs.
    size : number
        Angle of a pulse in rad.
    beside : int, optional
        Number of the K increments of a step that come from before it or from after it, as `windows` repeats them.

    Returns
    -------
    array, (..., N, K, 3)
        Whole multiples of the pulse, in rad.

    Raises
    ------
    InputError, InputTypeError
        If the increments are no numbers or have another shape, the size is not above 0, or the angle is more pulses
        than can be counted.

    Examples
    --------
    >>> pulses(np.full((4, 1, 3), 0.4), 1)[:, 0, 0]
    array([0., 1., 0., 1.])
    """
    pulse = float(checks.number("pulse", size, positive=True))
    d = checks.numbers("samples", samples, (None, None, 3))
    if beside and d.ndim > 3 and d.size:
        return np.stack([pulses(run, size, beside) for run in d])
    if beside and d.size:
        row = np.concatenate([d[0, :beside], d[:, beside:].reshape(-1, 3)])
        return windows(pulses(row[:, None], size)[:, 0], d.shape[1] - beside, beside)
    flat = d.reshape(*d.shape[:-3], -1, 3)
    angle = np.cumsum(flat, axis=-2) / pulse
    if not np.abs(angle).max(initial=0.0) < _MOST_PULSES:
        raise InputError(f"pulse is {pulse:g} rad; the run would take more pulses than can be counted")
    counts = np.diff(np.rint(angle), axis=-2, prepend=0.0)
    return (counts * pulse).reshape(d.shape)


class StepWindows:
    """Cuts a row of increments into those of each step, part by part from the first one on.

    Its parts have the bits of what `windows` and `pulses` return for the whole row.

    Parameters
    ----------
    read : callable
        ``read(first, stop)`` returns increments of the row, (stop - first, 3), in rad.
    count, beside : int
        As for `windows`.
    pulse : number, optional
        As for `pulses`; by default increments are not quantized.

    Examples
    --------
    >>> row = np.arange(24.0).reshape(8, 3)
    >>> StepWindows(lambda first, stop: row[first:stop], 2)(1, 2).shape  # steps 1 and 2, of 2 increments each
    (2, 2, 3)
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self._count} samples a step, {self._beside} beside it"

    def __init__(
        self,
        read: Callable[[int, int], Any],
        count: int,
        beside: int = 0,
        pulse: float | str | Fraction | None = None,
    ) -> None:
        self._read, self._count, self._beside = read, count, beside
        self._pulse = None if pulse is None else float(checks.number("pulse", pulse, positive=True))
        self._angle = self._pulses = np.zeros((1, 3))
        self._tail = np.empty((0, 3))

    def __call__(self, first: int, steps: int) -> NDArray[np.float64]:
        """Return the increments of the steps after those of the call before, (steps, beside + count, 3)."""
        begin = first * self._count + len(self._tail)
        row = np.asarray(self._read(begin, (first + steps) * self._count + self._beside))
        row = np.concatenate([self._tail, row if self._pulse is None else self._quantize(row, self._pulse)])
        self._tail = row[len(row) - self._beside :].copy()
        return windows(row, self._count, self._beside)

    @np.errstate(all="ignore")  # angles that overflow are refused, in one line
    def _quantize(self, row: NDArray[np.float64], pulse: float) -> NDArray[np.float64]:
        angles = np.cumsum(np.concatenate([self._angle, row]), axis=0)
        self._angle = angles[-1:]
        counts = np.rint(angles[1:] / pulse)
        if not np.abs(counts).max(initial=0.0) < _MOST_PULSES:
            raise InputError(f"pulse is {pulse:g} rad; the run would take more pulses than can be counted")
        before, self._pulses = self._pulses, counts[-1:]
        result: NDArray[np.float64] = np.diff(counts, axis=0, prepend=before) * pulse
        return result


def run_parts(steps: int, segment: int) -> Iterator[tuple[int, int, int]]:
    """Cut the steps of a run into parts that are propagated one after the other.

    Yields first step, number of steps, and steps from orthonormalization to orthonormalization in the part, 0 for
    never. A part holds whole segments, or a piece of one that is longer than `PART`.

    Examples
    --------
    >>> list(run_parts(5, 2))
    [(0, 5, 2)]
    """
    first = 0
    while first < steps:
        if segment and segment <= PART:
            count, every = min(PART // segment * segment, steps - first), segment
        else:
            until_end = segment - first % segment if segment else steps
            count = min(PART, until_end, steps - first)
            every = count if count == until_end and segment else 0
        yield first, count, every
        first += count
