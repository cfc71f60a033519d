"""Turns a program into exact quantities: trees of operations become sums of products, functions become series.

Ranges are proved on the way; an operation that fixed point does not have is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint import functions
from strapgen.fixedpoint.derived_sums import (
    SUM_OPERATIONS,
    DerivationContext,
    Samples,
    free_name,
    note_samples,
    operand_of,
    range_of,
    sampled,
    samples,
    stem,
    store,
    store_temporary,
    stored_terms,
    terms_of,
)
from strapgen.fixedpoint.functions import Chain
from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import (
    Definition,
    ExactOperation,
    InputElement,
    Operand,
    Quantities,
    Quantity,
    Sum,
    Terms,
    combined,
    scaled,
    up,
    used_by,
)
from strapgen.fixedpoint.ranges import Ranges
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, Reference, Result


def quantities(
    program: Program, ranges: Mapping[str, Interval], split: bool = False, word: int = 32
) -> Quantities:
    """Turn a program into exact quantities, given the range of every element of an input."""
    derived = _derive(program, tuple(ranges.items()), split, word)
    return Quantities(dict(derived.items), dict(derived.results))


@lru_cache(maxsize=8)
def _derive(program: Program, ranges: tuple[tuple[str, Interval], ...], split: bool, word: int) -> Quantities:
    """Derive the quantities once for all roundings and residuals of a kernel."""
    with np.errstate(all="ignore"):  # samples are hints: what is not finite hints at nothing
        context = _context(program, dict(ranges), split, word)
        for assignment in program.body:
            _assign(context, assignment)
        for result in program.outputs:
            context.quantities.results[result.signal.name] = _output_quantities(context, result)
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
    if assignment.remainder:
        quantity = context.items[name]
        error = quantity.approximation_error + up(assignment.remainder)
        context.items[name] = replace(quantity, approximation_error=error)


def _output_quantities(context: DerivationContext, result: Result) -> tuple[Operand, ...]:
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
    """Return whether a quantity can be an element of an output as it is stored."""
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


#: Functions on samples.
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "sinc": lambda x: np.sinc(x / np.pi),
    "atan2": np.arctan2,
    "direction": np.arctan2,
    "wrap": lambda x: np.where(x > np.pi, x - 2 * np.pi, np.where(x < -np.pi, x + 2 * np.pi, x)),
}


def derive_operation(context: DerivationContext, name: str, node: Operation, meaning: str) -> None:
    """Make the quantity of an operation that is no sum of products."""
    if node.kind not in _OPERATIONS:
        raise InputError(f"{context.program.kernel} uses {node.kind}, which fixed point does not have")
    _OPERATIONS[node.kind](context, name, node, meaning)


def _divide(context: DerivationContext, name: str, node: Operation, meaning: str) -> None:
    numerator = operand_of(context, node.arguments[0], f"{name}_numerator")
    denominator = operand_of(context, node.arguments[1], f"{name}_denominator")
    if isinstance(denominator, Fraction):
        if not denominator:
            raise ZeroDivisionError("a program divides by zero")
        terms: Terms = stored_terms(context, numerator) if isinstance(numerator, str) else {(): numerator}
        store(context, name, scaled(terms, 1 / denominator), meaning, whole=name in context.outputs)
        return
    _check_range(context, denominator)
    enclosure = range_of(context, numerator) * context.items[denominator].range.reciprocal()
    note_samples(context, name, lambda values: sampled(numerator, values) / values[denominator])
    _keep(context, name, ExactOperation("divide", (numerator, denominator)), enclosure, meaning)


def _square_root(context: DerivationContext, name: str, node: Operation, meaning: str) -> None:
    argument = _radicand(context, node.arguments[0], f"{stem(name)}_radicand")
    if isinstance(argument, Fraction):
        root = Interval.of(argument).sqrt()
        lowest = Sum((((), root.lowest),))
        width = root.highest - root.lowest
        context.items[name] = Quantity(name, lowest, Fraction(0), root, meaning, approximation_error=width)
        context.ranges.expanded[name] = None
        note_samples(context, name, lambda values: np.full(len(values[""]), float(root.lowest)))
        return
    _check_range(context, argument)
    inside = context.items[argument].range
    if inside.low < 0:
        raise InputError(
            f"{context.program.kernel}: {argument} may be below 0, its range is {inside.text()}; it has no square root"
        )
    note_samples(context, name, lambda values: np.sqrt(np.maximum(values[argument], 0)))
    _keep(context, name, ExactOperation("sqrt", (argument,)), inside.sqrt(), meaning)


def _radicand(context: DerivationContext, node: Node, name: str) -> Operand:
    """Return a radicand; a sum of squares as squares of words, so that it is not below 0."""
    factors = _squared_names(context, node)
    if not any(context.items[factor].exact_addends or context.items[factor].offset for factor in factors):
        return operand_of(context, node, name)
    terms: Terms = {}
    for factor in factors:
        whole = operand_of(context, Reference(factor), f"{factor}_whole")
        square: Terms = {(whole, whole): Fraction(1)} if isinstance(whole, str) else {(): whole * whole}
        terms = combined(terms, square, Fraction(1))
    return store_temporary(context, name, terms)


def _squared_names(context: DerivationContext, node: Node) -> list[str]:
    """Return the names whose squares a node is the sum of, squares with a name included; none if it is no such sum."""
    if isinstance(node, Reference):
        values = (assignment.value for assignment in context.program.body if assignment.name == node.name)
        node = next(
            (value for value in values if isinstance(value, Operation) and value.kind == "multiply"), node
        )
    if not isinstance(node, Operation):
        return []
    if node.kind == "add":
        parts = [_squared_names(context, argument) for argument in node.arguments]
        return [name for part in parts for name in part] if all(parts) else []
    left, right = node.arguments if node.kind == "multiply" else (None, None)
    return [left.name] if isinstance(left, Reference) and left == right else []


def _maximum(context: DerivationContext, name: str, node: Operation, meaning: str) -> None:
    arguments = tuple(operand_of(context, argument, f"{name}_argument") for argument in _flat(node))
    highest = max(arguments, key=lambda argument: range_of(context, argument).lowest)
    least = range_of(context, highest).lowest
    arguments = tuple(a for a in arguments if a == highest or range_of(context, a).highest > least)
    if arguments == (highest,) and isinstance(highest, str):  # the others are never above it
        store(context, name, stored_terms(context, highest), meaning, whole=name in context.outputs)
        return
    enclosure = maximum(range_of(context, argument) for argument in arguments)
    expansions: list[Terms | None] = [
        context.ranges.expanded.get(argument) if isinstance(argument, str) else {(): argument}
        for argument in arguments
    ]
    if all(expansion is not None for expansion in expansions):
        # The largest is at least the mean.
        mean: Terms = {}
        for expansion in expansions:
            mean = combined(mean, expansion or {}, Fraction(1, len(arguments)))
        middle = context.ranges.enclosure([(m, c) for m, c in mean.items() if c], context.ranges.box)
        enclosure = Interval(max(enclosure.low, middle.low), enclosure.high)

    def largest(values: Samples) -> NDArray[np.float64]:
        rows = [np.broadcast_to(sampled(argument, values), len(values[""])) for argument in arguments]
        return np.asarray(np.max(rows, axis=0))

    note_samples(context, name, largest)
    _keep(context, name, ExactOperation("maximum", arguments), enclosure, meaning)


def _flat(node: Node) -> list[Node]:
    """Return the arguments of a maximum, those of maxima among them included."""
    if isinstance(node, Operation) and node.kind == "maximum":
        return [inner for argument in node.arguments for inner in _flat(argument)]
    return [node]


def _select(context: DerivationContext, name: str, node: Operation, meaning: str) -> None:
    cases: list[tuple[Operand, Operand, Operand]] = []
    rest: Node = node
    while isinstance(rest, Operation) and rest.kind == "select":
        condition, yes, rest = rest.arguments
        if not isinstance(condition, Operation) or condition.kind != "at_least":
            raise InputError(f"{context.program.kernel}: the condition of {name} is no comparison")
        left, right = (operand_of(context, side, f"{name}_side") for side in condition.arguments)
        cases.append((left, right, operand_of(context, yes, f"{name}_case")))
    otherwise = operand_of(context, rest, f"{name}_case")
    enclosure = range_of(context, otherwise)
    for _, _, value in cases:
        enclosure = enclosure.join(range_of(context, value))

    def selected(values: Samples) -> NDArray[np.float64]:
        result = np.broadcast_to(sampled(otherwise, values), len(values[""]))
        for left, right, value in reversed(cases):
            condition = sampled(left, values) >= sampled(right, values)
            result = np.where(condition, sampled(value, values), result)
        return result

    note_samples(context, name, selected)
    operands = [operand for case in cases for operand in case]
    _keep(context, name, ExactOperation("select", (*operands, otherwise)), enclosure, meaning)


def _function(context: DerivationContext, name: str, node: Operation, meaning: str) -> None:
    """Make the quantities of a function, of which the last is its value."""
    arguments: list[str] = []
    for argument in node.arguments:
        operand = operand_of(context, argument, f"{name}_argument")
        if isinstance(operand, Fraction):
            operand = store_temporary(context, f"{name}_argument", {(): operand})
        arguments.append(operand)
    slope_distance = Fraction(0)
    if node.kind in ("atan2", "direction"):
        slope_distance = _distance_from_origin(context, name, *arguments)
    chain = Chain(name, context.items, context.same, partial(free_name, context), context.word)
    try:
        functions.derive_function(node.kind, chain, arguments, slope_distance)
    except ValueError as error:
        raise InputError(f"{context.program.kernel}: {error}") from None
    chain.links[-1] = replace(chain.links[-1], meaning=meaning)
    for quantity in chain.links:
        context.items[quantity.name] = quantity
        context.ranges.expanded[quantity.name] = None
    note_samples(context, name, lambda values: _FUNCTIONS[node.kind](*(values[a] for a in arguments)))


def _distance_from_origin(context: DerivationContext, name: str, ordinate: str, abscissa: str) -> Fraction:
    """Return the inverse of the largest slope of atan2 of inexact arguments: their least distance from the origin.

    That is proved, or checked when the code runs if they keep one in proper use; 0 where nothing is known.
    """
    definitions = [context.items[argument].definition for argument in (ordinate, abscissa)]
    if all(isinstance(definition, InputElement) for definition in definitions):
        return Fraction(0)
    terms: Terms = {}
    for argument, definition in zip((ordinate, abscissa), definitions, strict=True):
        square: Terms = {(argument, argument): Fraction(1)}
        match definition:
            case ExactOperation("sqrt", (str(radicand),)):
                square = stored_terms(context, radicand)
        terms = combined(terms, square, Fraction(1))
    distance = store_temporary(context, f"{name}_distance", terms)
    lengths = context.proper[distance]
    # Without a constraint inputs are proper up to the ends of their ranges, where samples tell only what is constant.
    if any(signal.constraint for signal in context.program.inputs) or np.ptp(lengths) <= np.min(lengths) / 64:
        _check_range(context, distance)
    least = context.items[distance].range
    if least.low > 0:
        # Two vectors of length L or more, d apart, are up to 2 asin(d/2L) apart in angle. A value that is checked
        # has an error below half its smaller end, so that d < 3L/4, the angle below 9/8 d/L; else below pi/2 d/L.
        part = Fraction(8, 9) if context.items[distance].range_checked else Fraction(7, 11)
        return least.sqrt().lowest * part
    del context.items[distance]
    return Fraction(0)


def _keep(
    context: DerivationContext, name: str, definition: Definition, enclosure: Interval, meaning: str
) -> None:
    """Add a quantity that is no sum, so that it has no expansion in the inputs."""
    context.items[name] = Quantity(name, definition, Fraction(0), enclosure, meaning)
    context.ranges.expanded[name] = None


def _check_range(context: DerivationContext, name: str) -> None:
    """Bound a divisor or a radicand away from zero by a check when the code runs.

    The limits are half the smallest and twice the largest value on proper inputs, to powers of two. Nothing is checked
    where these limits are proved, or where proper inputs come near zero.
    """
    quantity, values = context.items[name], context.proper[name]
    least, most = float(np.abs(values).min()), float(np.abs(values).max())
    if not math.isfinite(most):
        return
    one_sign = bool((values > 0).all() or (values < 0).all())
    low, high = quantity.range.low, quantity.range.high
    if not one_sign or least < most / 64:
        return
    near = Interval.of(
        Fraction(2) ** (round(math.log2(least)) - 1),
        Fraction(2) ** (math.ceil(math.log2(most) - 1e-6) + 1),
    )
    near = near if values[0] > 0 else -near
    tighter = quantity.range.meet(near)
    if low <= 0 <= high or (tighter.low > low and abs(low) < abs(tighter.low) // 2):
        context.items[name] = replace(quantity, range=tighter, range_checked=True)


_OPERATIONS: dict[str, Callable[[DerivationContext, str, Operation, str], None]] = {
    "divide": _divide,
    "sqrt": _square_root,
    "maximum": _maximum,
    "select": _select,
    **dict.fromkeys(_FUNCTIONS, _function),
}
