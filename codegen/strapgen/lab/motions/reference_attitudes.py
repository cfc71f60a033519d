"""Integrates the attitude of a rate that has no closed form, far more accurately than any algorithm under test.

The Magnus series of order 6 of the catalogue takes the rate at three Gauss-Legendre nodes of every substep. Substeps
lie on one grid whatever times are asked for, so that a kink of the rate on that grid costs no accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.ir.exceptions import InputError
from strapgen.run.backends import Backend, backend

Array = NDArray[np.float64]

#: Time from one attitude that is stored to the next in s.
KNOT = 0.01
#: Knots that are integrated together: some megabytes of rates.
_PART = 256
#: Gauss-Legendre nodes of a substep.
_NODES = 0.5 + np.array([-1.0, 0.0, 1.0]) * math.sqrt(15) / 10


class ReferenceAttitude:
    """The attitude that a body rate leads to, from the identity at time 0 on.

    `rate`: ``rate(times)`` returns body rates in rad/s, (..., 3), of times in s.

    >>> turn = ReferenceAttitude(lambda t: np.array([0, 0, np.pi]) * np.asarray(t)[..., None], 16)
    >>> turn(np.array([1.0]))[0].round(12) + 0.0  # the integral of pi t is a right angle after 1 s
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """

    def __init__(self, rate: Callable[[Array], Array], substeps: int) -> None:
        self._rate, self._substeps = rate, substeps
        self._states: Array = _magnus().identity[None]

    def __call__(self, time: Any) -> Array:
        """Return direction cosine matrices, body to reference.

        `time`: times in s, none below 0. Returns (..., 3, 3).
        """
        times = np.asarray(time, float)
        if times.min(initial=0.0) < 0:
            raise InputError(f"time is {times.min():g} s; the attitude is integrated from 0 on")
        matrices: Array = _magnus().matrices(self._at(times.ravel()))
        return matrices.reshape(*times.shape, 3, 3)

    def _at(self, times: Array) -> Array:
        """Return Euler parameters at some times, (N, 4)."""
        places = times / KNOT
        nearest = np.rint(places)
        on_knot = np.abs(places - nearest) <= 4 * np.finfo(float).eps * nearest
        knots = np.where(on_knot, nearest, np.floor(places)).astype(int)
        self._extend(int(knots.max(initial=0)))
        states: Array = self._states[knots]
        between = np.flatnonzero(~on_knot)
        for part in np.array_split(between, -(-len(between) // _PART)) if len(between) else []:
            states[part] = self._from_knots(states[part], knots[part], times[part])
        return states

    def _extend(self, last: int) -> None:
        """Store the states up to a knot, in whole parts: no bit depends on what was asked for before."""
        parts = [self._states]
        for first in range(len(self._states) - 1, last, _PART):
            starts = (first + np.arange(_PART * self._substeps) / self._substeps) * KNOT
            turns = self._turns(starts, np.full(starts.shape, KNOT / self._substeps))
            states = _magnus().propagate(turns, self._substeps, initial=parts[-1][-1])[1:]
            # The length of a product of rotations is 1 but for rounding.
            parts.append(states / np.linalg.norm(states, axis=1, keepdims=True))
        self._states = np.concatenate(parts)

    def _from_knots(self, states: Array, knots: NDArray[np.int_], times: Array) -> Array:
        """Return the states at times between knots, each from its knot on."""
        step = KNOT / self._substeps
        starts = knots[:, None] * KNOT + np.arange(self._substeps) * step
        lengths = np.clip(times[:, None] - starts, 0, step)
        turns = self._turns(starts, lengths)
        result: Array = _magnus().propagate(turns, self._substeps, initial=states)[:, -1]
        return result

    def _turns(self, starts: Array, lengths: Array) -> Array:
        """Return the rates at the nodes of some substeps, each times its length, (..., 3, 3)."""
        rates = self._rate(starts[..., None] + lengths[..., None] * _NODES)
        turns: Array = rates * lengths[..., None, None]
        return turns


@lru_cache(maxsize=1)
def _magnus() -> Backend:
    """Return the step that integrates."""
    return backend(catalogue.choose_step("euler", "magnus6", rates=True))
