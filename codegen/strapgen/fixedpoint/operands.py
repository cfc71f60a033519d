"""Brings the operands of comparisons and quotients to integers with the same number of fraction bits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.fixedpoint.quantities import Operand, is_dyadic
from strapgen.fixedpoint.quantization_context import Quantization
from strapgen.fixedpoint.terms import largest_wide, nearest
from strapgen.ir.exceptions import InputError
from strapgen.ir.integer_program import Scaled


@dataclass(frozen=True)
class _Operands:
    scaled: tuple[Scaled, ...]
    fraction: int  # bits
    error: Fraction  # the largest of all


def at_one_fraction(context: Quantization, operands: Sequence[Operand], lossless: bool = True) -> _Operands:
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
