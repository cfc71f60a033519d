"""Turns a program into exact quantities: trees of operations become sums of products, functions become series.

Ranges are proved on the way; an operation that fixed point does not have is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import numpy as np

from strapgen.fixedpoint.derivation_context import DerivationContext, free_name, samples
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.operations import derive_operation
from strapgen.fixedpoint.products import SUM_OPERATIONS, store, terms_of
from strapgen.fixedpoint.quantities import (
    ExactOperation,
    InputElement,
    Operand,
    Quantities,
    Quantity,
    used_by,
)
from strapgen.fixedpoint.ranges import Ranges
from strapgen.fixedpoint.terms import up
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result


def quantities(
    program: Program, ranges: Mapping[str, Interval], split: bool = False, word: int = 32
) -> Quantities:
    """Turn a program into exact quantities, given the range of every element of an input."""
    derived = _derived(program, tuple(ranges.items()), split, word)
    return Quantities(dict(derived.items), dict(derived.results))


@lru_cache(maxsize=8)
def _derived(
    program: Program, ranges: tuple[tuple[str, Interval], ...], split: bool, word: int
) -> Quantities:
    """Derive the quantities once for all roundings and residuals of a kernel."""
    with np.errstate(all="ignore"):  # samples are hints: what is not finite hints at nothing
        context = _context(program, dict(ranges), split, word)
        for assignment in program.body:
            _assign(context, assignment)
        for result in program.outputs:
            context.quantities.results[result.signal.name] = _held_whole(context, result)
    if program.transition is not None:
        context.quantities.results[program.transition.signal.name] = tuple(
            node.name if isinstance(node, Reference) else node.value
            for node in program.transition.nodes
            if isinstance(node, Reference | Constant)
        )
        _add_truncation(context)
    _drop_unused(context.quantities)
    return context.quantities


def _add_truncation(context: DerivationContext) -> None:
    """Add the truncation error of the transition's series to its elements."""
    program = context.program
    if (
        program.transition is None
        or program.attitude_step is None
        or program.attitude_step.truncation is None
    ):
        return
    truncation = program.attitude_step.truncation
    square = context.items[truncation.square]
    left_out = truncation.bound((square.range + Interval.of(square.offset)).magnitude)
    if left_out is None:
        raise InputError(f"{program.kernel}: its series does not converge for increments in that range")
    for name in context.quantities.results[program.transition.signal.name]:
        if isinstance(name, str):
            quantity = context.items[name]
            context.items[name] = replace(
                quantity, approximation_error=quantity.approximation_error + up(left_out)
            )


def _context(program: Program, ranges: Mapping[str, Interval], split: bool, word: int) -> DerivationContext:
    """Return the state before the first assignment: the inputs alone are known."""
    known = Quantities()
    proper, anywhere = samples(program.inputs, ranges)
    outputs = {
        node.name for result in program.outputs for node in result.nodes if isinstance(node, Reference)
    }
    for signal in program.inputs:
        for name in signal.elements:
            known.items[name] = Quantity(name, InputElement(signal.name), Fraction(0), ranges[name])
    return DerivationContext(
        program,
        split,
        word,
        derive_operation,
        known,
        Ranges(known.items, ranges),
        proper,
        anywhere,
        frozenset(outputs),
    )


def _assign(context: DerivationContext, assignment: Assignment) -> None:
    """Make the quantity of an assignment."""
    name, node = assignment.name, assignment.value
    if isinstance(node, Operation) and node.kind not in SUM_OPERATIONS:
        derive_operation(context, name, node, assignment.meaning)
    else:
        store(context, name, terms_of(context, node, name), assignment.meaning, whole=name in context.outputs)


def _held_whole(context: DerivationContext, result: Result) -> tuple[Operand, ...]:
    """Return the quantities of the elements of an output: each has one to itself, stored whole."""
    names: list[Operand] = []
    for element, node in zip(result.signal.elements, result.nodes, strict=True):
        name = node.name if isinstance(node, Reference) else ""
        if not name or name in names or not _is_whole_word(context.items[name]):
            name = free_name(context, element)
            store(context, name, terms_of(context, node, name), whole=True)
        names.append(name)
    return tuple(names)


def _is_whole_word(quantity: Quantity) -> bool:
    """Tell whether a quantity can be an element of an output as it is stored."""
    # A selection of values may be longer than a word: it is rounded to one. An input is no output.
    match quantity.definition:
        case InputElement() | ExactOperation("select"):
            return False
    return not quantity.offset and not quantity.exact_addends


def _drop_unused(known: Quantities) -> None:
    """Drop unused quantities: a function of a root may have been derived from its radicand."""
    results = (name for names in known.results.values() for name in names if isinstance(name, str))
    needed = set(results) | {quantity.name for quantity in known.items.values() if quantity.range_checked}
    for quantity in reversed(list(known.items.values())):
        if quantity.name in needed:
            needed.update(used_by(quantity))
        elif not isinstance(quantity.definition, InputElement):
            del known.items[quantity.name]
