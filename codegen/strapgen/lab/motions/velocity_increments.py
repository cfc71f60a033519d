"""Velocity increments of a constant specific force along an attitude."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Cycles whose velocity increments are computed together, and nodes of Gauss's rule in each.
_BLOCK, _NODES = 1 << 14, 4


def velocity_increments(
    attitude: Callable[[Array], Any], force: Iterable[float], interval: Fraction, count: int
) -> Array:
    """Return the velocity increments of a specific force that is constant in reference axes.

    `attitude`: returns direction cosine matrices, body to reference, at some times in s. `force`: in m/s^2,
    reference axes. `interval`: length of a cycle in s. Returns (count, 3): in m/s, body axes; Gauss's rule
    integrates each cycle.
    """
    vector, step = np.array([*force], float), float(interval)
    if not vector.any():
        return np.zeros((count, 3))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    parts = []
    for first in range(0, count, _BLOCK):
        begin = np.arange(first, min(first + _BLOCK, count)) * step
        matrices = np.asarray(attitude(begin[:, None] + step * (1 + nodes) / 2))
        parts.append(np.einsum("cnji,j,n->ci", matrices, vector, weights * step / 2))
    return np.concatenate(parts)
