"""Converts numbers to the integers of fixed-point arguments, and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_interface import Argument, Interface
from strapgen.ir.fixed_settings import DEFAULT_ALLOWANCE
from strapgen.run.evaluators import Array


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def integers(argument: Argument, values: Any, kernel: str) -> Array:
    """Return numbers as the integers of an input, rounded to the nearest.

    Raises
    ------
    InputError
        If one lies outside the input's range.
    """
    scaled = np.rint(in_units(argument, np.asarray(values, np.float64)))
    if argument.saturates:  # as a number that is rounded to the format
        near = np.abs(scaled) <= 2.0**argument.format.fraction * (1 + float(DEFAULT_ALLOWANCE))
        scaled = np.where(near, np.clip(scaled, argument.low, argument.high), scaled)
    outside = (scaled < argument.low) | (scaled > argument.high)
    if outside.any():
        worst = float(np.asarray(values)[outside].flat[0])
        limit = float(argument.high * argument.unit)
        raise InputError(
            f"{argument.signal.name} holds {worst:.9g}; the formats of {kernel} were chosen for at most "
            f"{limit:.9g} in magnitude"
        )
    whole = scaled.astype(np.int64)
    return whole.astype(object) if argument.format.word > 32 else whole


def numbers(argument: Argument, integers: Any) -> Array:
    """Return integers of an input or output as numbers."""
    whole = np.asarray(integers).astype(np.float64)
    if argument.sensor is not None:
        return np.asarray(whole * float(argument.unit))
    return np.ldexp(whole, -argument.format.fraction)


def in_units(argument: Argument, values: Array) -> Array:
    """Return numbers in units of an argument, not rounded yet."""
    if argument.sensor is not None:
        return np.asarray(values / float(argument.unit))
    return np.asarray(np.ldexp(values, argument.format.fraction))


def fresh_feedback(interface: Interface, count: int) -> Array:
    """Return the error feedback with which `count` independent runs begin, (count, number of words)."""
    integer_type: Any = object if interface.settings.word > 32 else np.int64
    return np.tile(np.array([word.fresh for word in interface.residuals], integer_type), (count, 1))


@dataclass(frozen=True)
class Memory:
    """What steps hand on: states, (runs, elements), error feedback, (runs, number of words), and their number."""

    state: Array
    feedback: Array
    first: int = 0


@cache
def array_type(kind: np.dtype[Any]) -> str:
    """Return the C type of an array of integers, whose name takes numpy longer to find than a short step takes."""
    return f"{kind.name}_t[]"
