"""Finds the convention that a user's function follows, and says how rotations about the axes come out."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.probes import Directions, direction_segments, directions
from strapgen.firmware.check_code.runs import SCALARS, SENSES, Convention, ForeignStep

Array = NDArray[np.float64]

#: Largest difference of an answer to a rotation about an axis, in units of the rotation.
DIRECTION_WITHIN = 0.1
#: The same for one that is no fault in itself, and for a factor that is known.
SIZE_WITHIN = _FACTOR_WITHIN = 0.01
#: Rotation below which a function does not turn at all, in units of the rotation.
_NOTHING = 1e-5


def convention_of(step: ForeignStep, declared: Directions) -> tuple[Convention | None, Directions]:
    """Return the convention that fits a function, the declared one first; None if none does."""
    if fits(declared.steady):
        return step.convention, declared
    scalars = SCALARS if step.source.arguments.elements == 4 else SCALARS[:1]
    others = [Convention(scalar, sense) for scalar, sense in product(scalars, SENSES)]
    ours = step.convention
    others.sort(key=lambda other: (other.scalar != ours.scalar) + (other.sense != ours.sense))
    for other in others:
        done = step.run(direction_segments(step), other)
        if not done.stopped:
            response = directions(step, done.runs)
            if fits(response.steady):
                return other, response
    return None, declared


def fits(response: Array) -> bool:
    """Return whether rotations about the axes come out as they are fed."""
    return bool(np.abs(response - np.eye(3)).max() < DIRECTION_WITHIN)


def off(response: Directions) -> float:
    """Return the largest difference of an answer to a rotation about an axis, in units of the rotation."""
    return float(np.abs(response.steady - np.eye(3)).max())


def sizes_in_words(response: Array) -> str:
    """Return in words by how much rotations come out too large that are about the right axes.

    `response` (3, 3): a rotation vector for each axis, in units of the rotation about it.
    """
    sizes = np.diag(response)
    if np.abs(response - np.diag(sizes)).max() > SIZE_WITHIN:
        return "a small rotation about an axis turns about others too"
    if np.ptp(sizes) < SIZE_WITHIN:
        return f"rotations come out {sizes.mean():.4g} times as large as they are fed"
    each = ", ".join(f"{size:.4g}" for size in sizes)
    return f"rotations about x, y, z come out {each} times as large as they are fed"


def in_words(step: ForeignStep, response: Array) -> str:
    """Return in words how rotations about the axes come out.

    `response` (3, 3): a rotation vector for each axis, in units of the rotation about it.
    """
    if not np.isfinite(response).all():
        return "a small rotation gives no attitude near the one before it"
    sizes = np.abs(response).max(axis=0)
    if np.all(sizes < _NOTHING):
        return "a small rotation about an axis does not turn the attitude"
    signs = np.where(np.abs(response) > sizes / 2, np.sign(response), 0)
    one_each = np.array_equal(np.abs(signs).sum(axis=0), np.ones(3)) and np.array_equal(
        np.abs(signs).sum(axis=1), np.ones(3)
    )
    factor = float(np.median(sizes))
    if not one_each or not np.allclose(response, factor * signs, atol=DIRECTION_WITHIN * factor):
        return "a small rotation about an axis is wrong in size or axis"
    parts = []
    if abs(factor - 1) >= DIRECTION_WITHIN:
        parts.append(_factor(step, factor))
    if not np.array_equal(signs, np.eye(3)):
        names = [
            ("-" if signs[:, k].sum() < 0 else "") + "xyz"[int(np.abs(signs[:, k]).argmax())]
            for k in range(3)
        ]
        parts.append(f"rotations about x, y, z turn about {', '.join(names)}")
    return "; ".join(parts)


def _factor(step: ForeignStep, factor: float) -> str:
    """Return in words why rotations come out so many times as large as they are fed."""
    interval = float(step.interval)
    known = {
        math.degrees(1): "degrees for radians, it turns radians into degrees",
        math.radians(1): "degrees for radians, it takes radians for degrees",
        interval: "it multiplies by the sampling interval what is an increment already",
        1 / interval: "it does not multiply rates by the sampling interval",
    }
    size = f"rotations come out {factor:.4g} times as large as they are fed"
    for value, said in known.items():
        if abs(factor / value - 1) < _FACTOR_WITHIN:
            return f"{said}: {size}"
    return size
