"""Writes quotients and square roots as rounded integers."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.operands import at_one_fraction
from strapgen.fixedpoint.quantities import ExactOperation, Quantity
from strapgen.fixedpoint.quantization_context import Quantization, integer_value
from strapgen.fixedpoint.sums import word_of
from strapgen.fixedpoint.terms import largest_wide
from strapgen.ir.formats import finest
from strapgen.ir.integer_program import IntegerOperation, Scaled


def lower_quotient(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a quotient to a word of the finest format for which the numerator has room."""
    word, values = context.word, context.values
    numerator, denominator = operation.arguments[0], str(operation.arguments[1])
    if values[denominator].error:  # what is exact, a wide number too, stays so
        denominator = word_of(context, denominator)
    if isinstance(numerator, str) and values[numerator].error:
        numerator = word_of(context, numerator)
    below, above = values[denominator], at_one_fraction(context, [numerator])
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
