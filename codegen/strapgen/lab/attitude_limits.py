"""Limits of computed attitudes: finite, and of the length of rotations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.run.backends import Backend

Array = NDArray[np.float64]


#: Largest length of an attitude: methods change it by far less where a step turns by a fraction of a rad.
LARGEST_LENGTH = 1.5


def require_proper(backend: Backend, states: Any, time: Array) -> None:
    """Refuse an attitude whose length has left 1 by more than small rotations make it."""
    if not backend.sources.function.inputs[0].constraint:
        return
    values = np.asarray(states, np.float64)
    with np.errstate(over="ignore"):  # a length beyond all numbers is refused too
        lengths = np.sqrt(np.square(values).sum(axis=tuple(range(1, values.ndim)))) / np.linalg.norm(
            backend.identity
        )
    wrong = np.flatnonzero((lengths > LARGEST_LENGTH) | (lengths < 1 / LARGEST_LENGTH))
    if len(wrong):
        place = int(wrong[0])
        raise InputError(
            f"the length of the attitude is {lengths[place]:.3g} at {time[place]:.6g} s, where 1 is needed: steps turn "
            "too far for the method; are the units of rate and time right? If they are, orthonormalize restores it"
        )


def require_finite(backend: Backend, states: Any, time: Array) -> None:
    """Refuse a run whose states are beyond the range of its back end.

    `states` has shape (N, state shape). `time` (N,): time of each state in s.
    """
    broken = ~np.isfinite(states.reshape(len(states), -1)).all(axis=1)
    if broken.any():
        cause = "the increments are too large for the method"
        if backend.takes == "increments" and backend.samples > 2:
            cause = (
                f"the increments, or the rates of the polynomial through {backend.samples} of them, are too large for "
                "the method"
            )
        raise InputError(
            f"the attitude is not finite from {time[broken][0]:.6g} s on; "
            f"steps of {backend.kernel} lengthen it: {cause}"
        )
