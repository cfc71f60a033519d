"""Writes operations that are no sums as integers: quotients, roots, maxima, selections and nearest integers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import ExactOperation, Operand, Quantity, is_dyadic
from strapgen.fixedpoint.quantization_context import Quantization, integer_value
from strapgen.fixedpoint.sums import word_of
from strapgen.fixedpoint.terms import largest_wide, nearest
from strapgen.ir.exceptions import InputError
from strapgen.ir.formats import finest
from strapgen.ir.integer_program import IntegerOperation, IntegerSum, Scaled, Term, cases_of

_EXACT = Fraction(0)


def lower_quotient(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a quotient to a word of the finest format for which the numerator has room."""
    word, values = context.word, context.values
    numerator, denominator = operation.arguments[0], str(operation.arguments[1])
    if values[denominator].error:  # what is exact, a wide number too, stays so
        denominator = word_of(context, denominator)
    if isinstance(numerator, str) and values[numerator].error:
        numerator = word_of(context, numerator)
    below, above = values[denominator], _at_one_fraction(context, [numerator])
    (top,) = above.scaled
    size = abs(top.value) if isinstance(top.value, int) else values[top.value].magnitude
    room = largest_wide(word) - below.magnitude
    least = min(abs(below.low), abs(below.high)) / Fraction(2) ** below.fraction
    inherited = (above.error + quantity.range.magnitude * below.error) / least
    is_forced = quantity.name in context.plan.forced
    fraction = context.plan.forced.get(quantity.name, finest(quantity.range.magnitude, word))
    while True:
        shift = fraction + below.fraction - above.fraction
        value = integer_value(
            context,
            quantity,
            IntegerOperation("divide", (Scaled(top.value, top.shift + shift), Scaled(denominator))),
            fraction,
            inherited + context.rounding_error / Fraction(2) ** fraction,
            size << max(0, shift),
        )
        if value.magnitude <= context.largest(fraction) and shift >= 0 and size << shift <= room:
            break
        if is_forced or fraction < -word:
            raise context.too_short(quantity.name)
        fraction -= 1
    context.add(value)


def lower_root(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a square root: as many places below the argument as a wide number has room for, an even number in all."""
    radicand = str(operation.arguments[0])
    argument, inside = context.values[radicand], context.quantities.items[radicand].range
    shift = 2 * context.word - 3 - max(1, argument.high).bit_length()
    shift -= (argument.fraction + shift) % 2
    fraction = (argument.fraction + shift) // 2
    lost = argument.error + (Fraction(2) ** -(2 * fraction) if shift < 0 else 0)
    least = inside.lowest - lost
    near_zero = Interval.of(0, lost).sqrt().highest
    error = lost / (2 * Interval.of(least).sqrt().lowest) if least > 0 else near_zero
    value = integer_value(
        context,
        quantity,
        IntegerOperation("sqrt", (Scaled(radicand, shift),)),
        fraction,
        error + context.rounding_error / Fraction(2) ** fraction,
        argument.high << shift if shift > 0 else argument.high,
    )
    value = replace(value, low=max(value.low, 0), high=min(value.high, 1 << (context.word - 1)))
    if value.magnitude > context.largest(fraction):
        raise context.too_short(quantity.name)
    context.add(value)


def lower_maximum(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower the largest of several quantities."""
    operands = _at_one_fraction(context, operation.arguments)
    _add(context, quantity, IntegerOperation("maximum", operands.scaled), operands.fraction, operands.error)


def lower_selection(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a selection; where a comparison is inexact, another case may be selected, and the error is the range."""
    conditions = cases_of(operation.arguments)
    outcomes = [*(outcome for _, _, outcome in conditions), operation.arguments[-1]]
    values = _at_one_fraction(context, outcomes, lossless=False)
    selected: list[Scaled] = []
    error = values.error
    for (left, right, _), value in zip(conditions, values.scaled, strict=False):
        selected += [*_at_one_fraction(context, [left, right]).scaled, value]
        if any(context.values[side].error for side in (left, right) if isinstance(side, str)):
            error += quantity.range.highest - quantity.range.lowest
    selection = IntegerOperation("select", (*selected, values.scaled[-1]))
    _add(context, quantity, selection, values.fraction, error)


def lower_computed(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Keep the computed value inside the range of the exact one, which brings it no farther from that."""
    argument = str(operation.arguments[0])
    name = word_of(context, argument)
    value = context.values[name]
    unit = Fraction(2) ** value.fraction
    low, high = math.ceil(quantity.range.lowest * unit), math.floor(quantity.range.highest * unit)
    if low > high:
        raise context.too_short(argument)
    cases: list[Scaled] = []
    if value.high > high:
        cases += [Scaled(name), Scaled(high), Scaled(high)]
    if value.low < low:
        cases += [Scaled(low), Scaled(name), Scaled(low)]
    whole = IntegerSum((Term((name,), 1),))
    clamped = IntegerOperation("select", (*cases, Scaled(name))) if cases else whole
    inside = integer_value(context, quantity, clamped, value.fraction, _EXACT, value.magnitude)
    context.add(replace(inside, low=max(low, value.low), high=min(high, value.high)))


def lower_nearest_integer(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Round a multiple to an integer, halves up whatever the rounding of words is."""
    argument, multiple = operation.arguments
    name, exact = word_of(context, str(argument)), Fraction(multiple)
    value = context.values[name]
    factor = exact.numerator
    shift = value.fraction + exact.denominator.bit_length() - 1
    if shift < 1:
        raise context.too_short(name)
    half = 1 << (shift - 1)
    terms = [Term((name,), factor)]
    if context.settings.rounding != "nearest":
        terms.append(Term((), half))
    peak = value.magnitude * abs(factor) + half
    integer = integer_value(context, quantity, IntegerSum(tuple(terms), shift), 0, _EXACT, peak)
    low, high = sorted((end * factor + half) >> shift for end in (value.low, value.high))
    context.add(replace(integer, low=low, high=high))


def _add(
    context: Quantization, quantity: Quantity, definition: IntegerOperation, fraction: int, error: Fraction
) -> None:
    """Add a value that is one of its operands: a wide number if a word does not hold it."""
    value = integer_value(context, quantity, definition, fraction, error, 0)
    peak = value.magnitude
    context.add(replace(value, wide=peak > context.largest(fraction), peak=peak))


# Operands at one fraction


@dataclass(frozen=True)
class _Operands:
    scaled: tuple[Scaled, ...]
    fraction: int  # bits
    error: Fraction  # the largest of all


def _at_one_fraction(context: Quantization, operands: Sequence[Operand], lossless: bool = True) -> _Operands:
    """Return operands as integers of one fraction: the finest of theirs, or if not `lossless` one with room for all."""
    room = largest_wide(context.word)
    fraction = max(_finest_fraction(context, operand) for operand in operands)
    while not lossless and max(_size(context, operand, fraction) for operand in operands) > room:
        fraction -= 1
    scaled: list[Scaled] = []
    error = Fraction(0)
    for operand in operands:
        if isinstance(operand, Fraction):
            integer = nearest(operand * Fraction(2) ** fraction)
            error = max(error, abs(integer / Fraction(2) ** fraction - operand))
            scaled.append(Scaled(integer))
        else:
            value = context.values[operand]
            lost = Fraction(2) ** -fraction if fraction < value.fraction else Fraction(0)
            error = max(error, value.error + lost)
            scaled.append(Scaled(operand, fraction - value.fraction))
        if _size(context, operand, fraction) > room:
            raise InputError(
                f"{context.program.kernel}: words of {context.word} bits are too short to compare {operand}"
            )
    return _Operands(tuple(scaled), fraction, error)


def _finest_fraction(context: Quantization, operand: Operand) -> int:
    """Return the fraction bits at which an operand is exact; of a number without end, those of a word."""
    if isinstance(operand, str):
        return context.values[operand].fraction
    return operand.denominator.bit_length() - 1 if is_dyadic(operand) else context.word


def _size(context: Quantization, operand: Operand, fraction: int) -> int:
    """Return the largest magnitude of an operand as an integer of so many fraction bits."""
    if isinstance(operand, Fraction):
        return abs(nearest(operand * Fraction(2) ** fraction))
    value = context.values[operand]
    return math.ceil(value.magnitude * Fraction(2) ** (fraction - value.fraction))


#: Lowers each kind of operation to integers that stand for a quantity.
LOWER: dict[str, Callable[[Quantization, Quantity, ExactOperation], None]] = {
    "divide": lower_quotient,
    "sqrt": lower_root,
    "maximum": lower_maximum,
    "select": lower_selection,
    "computed": lower_computed,
    "nearest": lower_nearest_integer,
}
