"""Writes results of comparisons as integers: maxima, selections, values limited to their range, nearest integers."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

from strapgen.fixedpoint.operands import at_one_fraction
from strapgen.fixedpoint.quantities import Computed, Maximum, NearestInteger, Quantity, Selection
from strapgen.fixedpoint.quantization_context import Quantization, integer_value
from strapgen.fixedpoint.sums import word_of
from strapgen.ir.integer_program import (
    IntegerDefinition,
    IntegerMaximum,
    IntegerSelection,
    IntegerSum,
    Scaled,
    Term,
)

_EXACT = Fraction(0)
_Case = tuple[Scaled, Scaled, Scaled]


def lower_maximum(context: Quantization, quantity: Quantity, definition: Maximum) -> None:
    """Lower the largest of several quantities."""
    operands = at_one_fraction(context, definition.arguments)
    _add(context, quantity, IntegerMaximum(operands.scaled), operands.fraction, operands.error)


def lower_selection(context: Quantization, quantity: Quantity, definition: Selection) -> None:
    """Lower a selection; where a comparison is inexact, another case may be selected, and the error is the range."""
    outcomes = [*(outcome for _, _, outcome in definition.cases), definition.otherwise]
    values = at_one_fraction(context, outcomes, lossless=False)
    cases: list[_Case] = []
    error = values.error
    for (left, right, _), value in zip(definition.cases, values.scaled, strict=False):
        one, other = at_one_fraction(context, [left, right]).scaled
        cases.append((one, other, value))
        if any(context.values[side].error for side in (left, right) if isinstance(side, str)):
            error += quantity.range.highest - quantity.range.lowest
    selection = IntegerSelection(tuple(cases), values.scaled[-1])
    _add(context, quantity, selection, values.fraction, error)


def lower_computed(context: Quantization, quantity: Quantity, definition: Computed) -> None:
    """Keep the computed value inside the range of the exact one, which brings it no farther from that."""
    name = word_of(context, definition.argument)
    value = context.values[name]
    unit = Fraction(2) ** value.fraction
    low, high = math.ceil(quantity.range.lowest * unit), math.floor(quantity.range.highest * unit)
    if low > high:
        raise context.too_short(definition.argument)
    cases: list[_Case] = []
    if value.high > high:
        cases.append((Scaled(name), Scaled(high), Scaled(high)))
    if value.low < low:
        cases.append((Scaled(low), Scaled(name), Scaled(low)))
    clamped: IntegerDefinition = IntegerSelection(tuple(cases), Scaled(name))
    if not cases:
        clamped = IntegerSum((Term((name,), 1),))
    inside = integer_value(context, quantity, clamped, value.fraction, _EXACT, value.magnitude)
    context.add(replace(inside, low=max(low, value.low), high=min(high, value.high)))


def lower_nearest_integer(context: Quantization, quantity: Quantity, definition: NearestInteger) -> None:
    """Round a multiple to an integer, halves up whatever the rounding of words is."""
    name = word_of(context, definition.argument)
    value = context.values[name]
    factor = definition.factor.numerator
    shift = value.fraction + definition.factor.denominator.bit_length() - 1
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
    context: Quantization, quantity: Quantity, definition: IntegerDefinition, fraction: int, error: Fraction
) -> None:
    """Add a value that is one of its operands: a wide number if a word does not hold it."""
    value = integer_value(context, quantity, definition, fraction, error, 0)
    peak = value.magnitude
    context.add(replace(value, wide=peak > context.largest(fraction), peak=peak))
