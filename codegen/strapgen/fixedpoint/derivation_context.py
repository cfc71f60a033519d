"""`DerivationContext` holds the quantities derived so far from a program, with their ranges and sample values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import Definition, Operand, Quantities, Quantity, Sum, Terms
from strapgen.fixedpoint.ranges import Ranges
from strapgen.ir.program import Operation, Program
from strapgen.ir.signals import Signal

#: Number of sample inputs. They hint where a range may be narrower than proved; no proof rests on them.
_COUNT = 500

#: Values of quantities on sample inputs, by name; the key "" holds the numbers of the samples.
Samples = dict[str, NDArray[np.float64]]


@dataclass
class DerivationContext:
    """The state of a walk over a program."""

    program: Program
    split: bool  # whether what differs little from an exact sum of inputs is stored as its distance from that
    word: int  # bits
    #: Makes the quantity of an operation that is no sum of products, from its name, the operation and the meaning.
    derive_operation: Callable[[DerivationContext, str, Operation, str], None]
    quantities: Quantities  # those derived so far
    ranges: Ranges
    proper: Samples  # values of the quantities on proper inputs
    anywhere: Samples  # the same anywhere in the ranges of the inputs
    outputs: frozenset[str]  # assignments that hold elements of results
    #: Links of functions: equal ones are stored once.
    same: dict[Definition, str] = field(default_factory=dict)
    items: dict[str, Quantity] = field(init=False)  # those of `quantities`
    assigned: frozenset[str] = field(init=False)  # names of all assignments of the program

    def __post_init__(self) -> None:
        self.items = self.quantities.items
        self.assigned = frozenset(assignment.name for assignment in self.program.body)


def note_samples(context: DerivationContext, name: str, evaluate: Callable[[Samples], Any]) -> None:
    """Keep the values of a quantity on both sets of samples."""
    context.proper[name] = evaluate(context.proper)
    context.anywhere[name] = evaluate(context.anywhere)


def sampled(operand: Operand, values: Samples) -> Any:
    """Return the values of a quantity, or a constant, on samples."""
    return float(operand) if isinstance(operand, Fraction) else values[operand]


def range_of(context: DerivationContext, operand: Operand) -> Interval:
    """Return the proved range of a quantity or a constant."""
    return Interval.of(operand) if isinstance(operand, Fraction) else context.items[operand].range


def free_name(context: DerivationContext, name: str) -> str:
    """Return the name, or the name with a number behind it, whichever is free."""
    candidates = (name if number == 1 else f"{name}_{number}" for number in count(1))
    return next(
        candidate
        for candidate in candidates
        if candidate not in context.items and candidate not in context.assigned
    )


def stored_terms(context: DerivationContext, name: str) -> Terms:
    """Return a quantity, its offset included, as a sum of stored quantities."""
    quantity = context.items[name]
    definition = quantity.definition
    if (
        isinstance(definition, Sum)
        and not quantity.approximation_error
        and not any(m for m, _ in definition.terms)
    ):
        constant = quantity.offset + sum((c for _, c in definition.terms), Fraction(0))
        return {(): constant} if constant else {}
    offset: Terms = {(): quantity.offset} if quantity.offset else {}
    return offset | dict(quantity.exact_addends) | {(name,): Fraction(1)}


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
            if signal.constraint == "rotation":
                unit = _of_length_one(vectors)
                v, s = unit[:, :3], unit[:, 3:, None]
                skew = np.cross(np.eye(3), v[:, None, :])
                rotation = np.eye(3) * (2 * s**2 - 1) + 2 * v[:, :, None] * v[:, None, :] - 2 * s * skew
                inside = rotation.reshape(_COUNT, 9)
            else:
                inside = _of_length_one(vectors[:, : signal.size]) if signal.size <= 4 else box
        for k, name in enumerate(signal.elements):
            proper[name], anywhere[name] = inside[:, k], box[:, k]
    assert all(math.isfinite(float(values.max())) for values in anywhere.values())
    return proper, anywhere


def _of_length_one(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors divided by their lengths; the last axis stands for a vector of zeros."""
    vectors = vectors.copy()
    vectors[~vectors.any(axis=1), -1] = 1
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
