"""Writes results of comparisons as integers: maxima, selections, values limited to their range, nearest integers."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

from strapgen.fixedpoint.operands import at_one_fraction
from strapgen.fixedpoint.quantities import ExactOperation, Quantity
from strapgen.fixedpoint.quantization_context import Quantization, integer_value
from strapgen.fixedpoint.sums import word_of
from strapgen.ir.integer_program import IntegerOperation, IntegerSum, Scaled, Term, cases_of

_EXACT = Fraction(0)


def lower_maximum(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower the largest of several quantities."""
    operands = at_one_fraction(context, operation.arguments)
    _add(context, quantity, IntegerOperation("maximum", operands.scaled), operands.fraction, operands.error)


def lower_selection(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a selection; where a comparison is inexact, another case may be selected, and the error is the range."""
    conditions = cases_of(operation.arguments)
    outcomes = [*(outcome for _, _, outcome in conditions), operation.arguments[-1]]
    values = at_one_fraction(context, outcomes, lossless=False)
    selected: list[Scaled] = []
    error = values.error
    for (left, right, _), value in zip(conditions, values.scaled, strict=False):
        selected += [*at_one_fraction(context, [left, right]).scaled, value]
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
