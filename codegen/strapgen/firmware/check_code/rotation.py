"""Looks at the rotation that a user's function makes of one constant rate, whatever attitude it begins from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.replacement import FIRST_ORDER, explanation
from strapgen.firmware.check_code.runs import Convention, ForeignStep, Segment, SegmentRun, rotation_vectors

Array = NDArray[np.float64]
#: Largest angle in rad of a call, for terms of third order, and what part of it the one for those of second order is.
_LARGE, _PART = 0.2, 0.1
#: Rotations in rad that the small angle is turned from, and fewest calls that lead there.
_ATTITUDES, _CALLS = ((0, 0, 0), (0.9, 0.2, -0.4), (-0.3, 0.8, 0.7), (0.5, -1.1, 0.6)), 10
_SMALL_ABOUT = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1))
_LARGE_ABOUT = ((1, 0, 0), (1, -2, 3))
#: Least coefficients of the square and of the cube of the angle that are an error; higher terms are in the latter.
_SQUARE, _CUBE = 0.01, 0.004
#: What formulas of first order turn by in place of an angle, and the words for that.
_FORMULAS = ((lambda angle: 2 * math.atan(angle / 2), "2 atan(d/2)"), (math.atan, "atan(d)"))


@dataclass(frozen=True)
class Rotation:
    """What a function makes of a constant rate."""

    #: Its error by the square and by the cube of the angle
    square: float
    cube: float
    #: Order of the whole that it allows, 3 if it is enough for a published correction
    order: int
    #: Why it is not exact
    cause: str | None

    @property
    def text(self) -> str:
        """What is seen, in words."""
        if self.order == 1:
            return f"a rotation by d is off by {self.square:.3g} d^2"
        if self.order == 2:
            return f"a rotation by d turns by d {'+' if self.cube > 0 else '-'} {abs(self.cube):.3g} d^3"
        return "a constant rate is turned by exactly"


def rotation_segments(step: ForeignStep) -> list[Segment]:
    """Return the segments that `rotation` needs of a function."""
    segments = []
    for attitude, vector in product(_ATTITUDES, _vectors(_SMALL_ABOUT, _PART * _large(step))):
        count = step.calls_for(float(np.linalg.norm(attitude)), _CALLS)
        before = np.array(attitude, float) / (count * step.samples)
        segments.append(_constant(step, vector, np.tile(before, (count, step.samples, 1))))
    nothing = np.zeros((0, step.samples, 3))
    large = _vectors(_LARGE_ABOUT, _large(step))
    return [*segments, *(_constant(step, vector, nothing) for vector in large)]


def _constant(step: ForeignStep, vector: Array, before: Array) -> Segment:
    """Return calls with a constant rate, so many that a memory of samples is filled by them."""
    calls = np.tile(vector / step.samples, (step.settling + 1, step.samples, 1))
    return Segment(np.concatenate([before, calls]))


def _vectors(about: Sequence[tuple[int, ...]], size: float) -> Array:
    axes = np.array(about, float)
    vectors = size * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return np.concatenate([vectors, -vectors])


def _large(step: ForeignStep) -> float:
    """Return the large angle, at a rate that a gyro measures."""
    return min(_LARGE, step.samples * step.most)


def rotation(step: ForeignStep, convention: Convention, runs: Sequence[SegmentRun]) -> Rotation:
    """Return what a function makes of a constant rate."""
    turns = rotation_vectors(np.array([run.relative[-2].T @ run.relative[-1] for run in runs]))
    angle = _large(step)
    least = _PART * angle
    small = _vectors(_SMALL_ABOUT, least)
    vectors = np.tile(small, (len(_ATTITUDES), 1))
    errors = turns[: len(vectors)] - vectors
    square = float(np.linalg.norm(errors.reshape(-1, 2, len(small) // 2, 3).mean(axis=1), axis=-1).max())
    square /= least**2
    # What is proportional to the angle is a fault of sizes and axes; here only what is beyond it counts.
    proportional = np.linalg.lstsq(vectors, turns[: len(vectors)], rcond=None)[0]
    about = _vectors(_LARGE_ABOUT, 1.0) @ proportional
    gains = np.linalg.norm(about, axis=1)
    turned = (turns[len(vectors) :] * about).sum(axis=1) / gains
    cube = float(((turned / angle - gains) / (angle**2 - least**2)).mean())
    if square > _SQUARE + 4 * step.unit / least**2:
        states = np.array([run.states[-2] for run in runs[: len(vectors)]])
        cause = None if states.shape[1] == 3 else explanation(convention, states, vectors, errors)
        return Rotation(square, cube, 1, cause)
    rounding = 4 * step.unit / (least * angle**2)
    if abs(cube) <= _CUBE + rounding:
        return Rotation(square, cube, 3, None)
    for formula, words in _FORMULAS:
        if all(
            abs(turn - formula(gain * angle)) < (_CUBE / 2 + rounding) * angle**3
            for turn, gain in zip(turned, gains, strict=True)
        ):
            return Rotation(square, cube, 2, f"{FIRST_ORDER}: it turns by {words} in place of d")
    return Rotation(square, cube, 2, "the rotation itself is of second order")
