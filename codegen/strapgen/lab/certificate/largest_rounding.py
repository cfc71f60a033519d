"""The largest rounding of a run over steps, for results that show it in passing."""

from __future__ import annotations

import importlib.util
import math
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.run.backend_names import BACKENDS
from strapgen.run.backends import Backend

#: Instants at which a run is certified, about, and the longest word whose states a double holds.
_INSTANTS, _LONGEST_WORD = 200, 53


class LargestRounding(NamedTuple):
    """An angle in rad from exact arithmetic, and the radius of its ball."""

    angle: float
    radius: float


def has_balls() -> bool:
    """Return whether the library of balls is installed."""
    return importlib.util.find_spec("flint") is not None


def largest_rounding(
    backend: Backend, states: NDArray[np.float64], samples: NDArray[np.float64]
) -> LargestRounding | None:
    """Return the largest angle that rounding has made of the states of a run without orthonormalization.

    `states` (N + 1, state shape): at the start, and after each step. `samples` (N, K, 3): increments of the steps in
    rad, as the step takes them. None without python-flint, for longer words or many digits, for a step that multiplies
    by no transition, and where an angle reaches a quarter turn.
    """
    fixed, choice = backend.sources.fixed, backend.choice
    if not (has_balls() and len(samples)) or choice is None or BACKENDS[backend.name].many_digits:
        return None
    if fixed is not None and fixed.inputs[0].format.word > _LONGEST_WORD:
        return None
    from strapgen.lab.certificate.certificate import roundings

    steps, inside = len(samples), backend.increments
    each = next(n for n in range(-(-steps // _INSTANTS), steps + 1) if steps % n == 0)
    blocks = [samples[k : k + each] for k in range(0, steps, each)]
    rows = [np.concatenate([part[:, :inside].reshape(-1, 3), part[-1, inside:]]) for part in blocks]
    with suppress(InputError):
        angles = [one.angle for one in roundings(choice, each, [*states[::each]], rows)]
        if all(math.isfinite(angle.size) for angle in angles):
            largest = max(angles, key=lambda angle: angle.size)
            return LargestRounding(largest.size, largest.radius)
    return None
