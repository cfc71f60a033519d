"""Computes sample inputs of a program, which hint where a range may be narrower than proved; no proof rests on them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.signals import Signal

_COUNT = 500


def samples(
    signals: Sequence[Signal], ranges: Mapping[str, Interval]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Return values of every input element: on proper inputs, and anywhere in their ranges.

    Proper inputs meet the constraint of their signal: vectors of length 1 and rotations. The others lie at the corners
    of the box, on its edges and inside. The key "" holds the numbers of the samples.
    """
    rng = np.random.default_rng(0)
    numbers = np.arange(_COUNT, dtype=np.float64)
    proper: dict[str, NDArray[np.float64]] = {"": numbers}
    anywhere: dict[str, NDArray[np.float64]] = {"": numbers}
    for signal in signals:
        low = np.array([float(ranges[name].lowest) for name in signal.elements])
        high = np.array([float(ranges[name].highest) for name in signal.elements])
        part = rng.random((_COUNT, signal.size))
        part[: _COUNT // 2] = part[: _COUNT // 2].round()
        part[_COUNT // 2 : _COUNT * 3 // 4] = (2 * part[_COUNT // 2 : _COUNT * 3 // 4]).round() / 2
        box = low + part * (high - low)
        inside = box
        if signal.constraint:
            # Turns by quarters and corners first, where the extremes are, then random ones.
            vectors = rng.normal(size=(_COUNT, 4))
            vectors[:200] = vectors[:200].round()
            vectors[~vectors.any(axis=1)] = [0, 0, 0, 1]
            unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
            if signal.constraint == "rotation":
                v, s = unit[:, :3], unit[:, 3:, None]
                skew = np.cross(np.eye(3), v[:, None, :])
                rotation = np.eye(3) * (2 * s**2 - 1) + 2 * v[:, :, None] * v[:, None, :] - 2 * s * skew
                inside = rotation.reshape(_COUNT, 9)
            else:
                inside = unit[:, : signal.size] if signal.size <= 4 else box
        for k, name in enumerate(signal.elements):
            proper[name], anywhere[name] = inside[:, k], box[:, k]
    assert all(math.isfinite(float(values.max())) for values in anywhere.values())
    return proper, anywhere
