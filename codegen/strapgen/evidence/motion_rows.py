"""The integers that the inputs of a kernel have along a motion that cones."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.ir.interfaces import Argument, Interface
from strapgen.lab.motions.motions import GENERAL, Motion, motion
from strapgen.run.backends import evaluator

#: Time between two rows in s.
_STEP = Fraction(1, 8)
#: Part of its range that an input fills which has not the constraint of an attitude.
_PART = 0.9


def motion_rows(interface: Interface, count: int, part: float = _PART) -> tuple[tuple[int, ...], ...]:
    """Return the elements of all inputs along a motion whose axis and angle change."""
    coning = motion("coning", **GENERAL)
    columns = [_column(argument, coning, count, part) for argument in interface.inputs]
    return tuple(
        tuple(int(value) for column in columns for value in column[number]) for number in range(count)
    )


def _column(argument: Argument, coning: Motion, count: int, part: float) -> Any:
    """Return the integers of an input, (count, elements)."""
    signal = argument.signal
    if signal.constraint:
        values = coning.attitude(np.arange(count) * float(_STEP))
        if signal.constraint == "unit":
            (values,) = (np.asarray(evaluator("euler-from-dcm")(values)),)
        scaled = values.reshape(count, signal.size) / float(argument.unit)
    else:
        samples = -(-signal.size // 3)
        values = coning.increments(_STEP, count, samples).reshape(count, 3 * samples)[:, : signal.size]
        scaled = values * (part * argument.high / float(np.abs(values).max()))
    return np.clip(np.rint(scaled), float(argument.low), float(argument.high)).astype(object)
