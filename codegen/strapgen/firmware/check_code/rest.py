"""Looks at what a user's function does without rotation of the body: nothing, or a rotation at a constant rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.runs import ForeignStep, Segment, SegmentRun, rotation_vectors

Array = NDArray[np.float64]

#: Calls without rotation: many, so that a rate as slow as that of the earth is seen in single precision too.
_FEW, _MANY = 10, 1000
#: Rotation in rad that leads to another attitude, and fewest calls of it.
_APPROACH, _CALLS = (0.5, -1.1, 0.6), 10
#: Rotation of all these calls that is no rounding, in units in the last place.
_UNITS = 64
#: Largest difference of two rates that are the same, by their size.
_ALIKE = 0.05
#: Part of a rate about an axis that is none.
_NOTHING = 1e-4


@dataclass(frozen=True)
class Rest:
    """What a function does without rotation."""

    #: Largest change of an element of the state
    moved: float
    #: (3,): rotation of a call, the same in reference axes at every attitude, in rad; 0 if there is none
    frame: Array
    #: (3,): the same in body axes
    body: Array
    #: Whether it turns otherwise than a frame that moves at a constant rate
    strays: bool

    def causes(self, seconds: float) -> list[str]:
        """Return the likely causes, for calls of a duration in s."""
        said = []
        if self.frame.any():
            said.append(f"the frame moves at a constant rate, {_rate(-self.frame / seconds)}")
        if self.body.any():
            said.append(f"a constant rate is added to that of the gyro, {_rate(self.body / seconds)}")
        return said


def rest_segments(step: ForeignStep) -> list[Segment]:
    """Return the segments that `rest` needs of a function."""
    nothing = np.zeros((_MANY, step.samples, 3))
    count = step.calls_for(float(np.linalg.norm(_APPROACH)), _CALLS)
    turns = np.tile(np.array(_APPROACH) / (count * step.samples), (count, step.samples, 1))
    return [Segment(nothing), Segment(np.concatenate([turns, nothing[: step.settling], nothing]))]


def rest(step: ForeignStep, runs: Sequence[SegmentRun]) -> Rest:
    """Return what a function does without rotation."""
    states, none = runs[0].states, np.zeros(3)
    reference = states[0] if states.shape[1] != 3 else none  # of a rotation vector nothing is to be left
    moved = float(np.abs(states - reference).max())
    in_frame, in_body = zip(*map(_turns_of_a_call, runs), strict=True)
    size = float(np.linalg.norm(in_frame[0]))
    if size * _MANY < _UNITS * step.unit:
        return Rest(moved, none, none, strays=False)
    same = [
        float(np.linalg.norm(here - there)) < _ALIKE * size + 2 * step.unit
        for here, there in (in_frame, in_body)
    ]
    if same == [True, False]:
        return Rest(moved, in_frame[0], none, strays=False)
    return Rest(moved, none, in_body[0] if same == [False, True] else none, strays=True)


def _turns_of_a_call(run: SegmentRun) -> tuple[Array, Array]:
    """Return the rotation vector of a call without rotation in reference axes and in body axes; nan if it changes."""
    calls = run.relative[-1 - _MANY :]
    count = _MANY if np.linalg.norm(rotation_vectors(calls[0].T @ calls[_FEW])) * _MANY < _FEW else _FEW
    first, half, last = calls[0], calls[count // 2], calls[count]
    whole, part = (rotation_vectors(first.T @ after) / count for after in (last, half))
    if np.linalg.norm(whole - 2 * part) > _ALIKE * np.linalg.norm(whole):
        return np.full(3, np.nan), np.full(3, np.nan)
    return run.start @ rotation_vectors(last @ first.T) / count, whole


def _rate(rate: Array) -> str:
    hourly = np.degrees(rate) * 3600
    size = math.hypot(*hourly)
    parts = ", ".join(f"{part:.4g}" if abs(part) > size * _NOTHING else "0" for part in hourly)
    return f"{size:.4g} deg/h ({parts} about x, y, z)"
