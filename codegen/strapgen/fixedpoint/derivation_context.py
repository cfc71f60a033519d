"""`DerivationContext` holds the quantities derived so far from a program, with their ranges and sample values."""

from __future__ import annotations

from collections.abc import Callable
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

#: Values of quantities on sample inputs, by name; the key "" holds the numbers of the samples.
Samples = dict[str, NDArray[np.float64]]


@dataclass
class DerivationContext:
    """The state of a walk over a program.

    Parameters
    ----------
    program : Program
    split : bool
        Whether what differs little from an exact sum of inputs is stored as its distance from that.
    word : int
        Bits of a word.
    derive_operation : callable
        Makes the quantity of an operation that is no sum of products, from its name, the operation and the meaning.
    quantities : Quantities
        The quantities so far.
    ranges : Ranges
        Proves ranges from those of the quantities so far.
    proper, anywhere : dict of str to array
        Values of the quantities on proper inputs, and anywhere in the ranges of the inputs.
    outputs : frozenset of str
        Assignments that hold elements of results.
    same : dict of Definition to str
        Quantities of which functions were made, by definition: equal ones are stored once.
    items : dict of str to Quantity
        The quantities so far, by name.
    assigned : frozenset of str
        Names of all assignments of the program.
    """

    program: Program
    split: bool
    word: int
    derive_operation: Callable[[DerivationContext, str, Operation, str], None]
    quantities: Quantities
    ranges: Ranges
    proper: Samples
    anywhere: Samples
    outputs: frozenset[str]
    same: dict[Definition, str] = field(default_factory=dict)
    items: dict[str, Quantity] = field(init=False)
    assigned: frozenset[str] = field(init=False)

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
    """Return the name, or with a number behind it one that is free."""
    candidates = (name if number == 1 else f"{name}_{number}" for number in count(1))
    return next(
        candidate
        for candidate in candidates
        if candidate not in context.items and candidate not in context.assigned
    )


def stored_terms(context: DerivationContext, name: str) -> Terms:
    """Return a quantity, its offset included, in terms of what is stored."""
    quantity = context.items[name]
    definition = quantity.definition
    if isinstance(definition, Sum) and not quantity.inexact and not any(m for m, _ in definition.terms):
        constant = quantity.offset + sum((c for _, c in definition.terms), Fraction(0))
        return {(): constant} if constant else {}
    offset: Terms = {(): quantity.offset} if quantity.offset else {}
    return offset | dict(quantity.beside) | {(name,): Fraction(1)}
