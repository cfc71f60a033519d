"""Bounds the derivatives of results by every operation, in interval arithmetic over the box of the inputs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction

from strapgen.fixedpoint.floating.expressions import CONSTANT, INPUT, Expression, Expressions
from strapgen.fixedpoint.intervals import Interval

_ZERO = Interval(0, 0)
_ONE = Interval.of(1)
#: One of two operands moves a result, or a mean of both does.
_SHARE = Interval.of(0, 1)


def slopes(expressions: Expressions, ranges: Sequence[Interval]) -> list[tuple[Interval, ...]]:
    """Return the derivatives of every operation by its operands, at the exact values.

    A maximum and a selection move with one operand, or between both. A root that may be zero has the slope 0: its error
    is bounded as a whole.
    """
    return [
        _slopes(expression, [ranges[k] for k in expression.arguments], ranges[place])
        for place, expression in enumerate(expressions.items)
    ]


def _slopes(expression: Expression, operands: Sequence[Interval], value: Interval) -> tuple[Interval, ...]:
    match expression.kind:
        case "add":
            return _ONE, _ONE
        case "subtract":
            return _ONE, -_ONE
        case "negate":
            return (-_ONE,)
        case "multiply":
            return operands[1], operands[0]
        case "divide":
            inverse = operands[1].reciprocal()
            return inverse, -(value * inverse)
        case "sqrt":
            return (value.scale(Fraction(2)).reciprocal() if value.low > 0 else _ZERO,)
        case "maximum":
            return _SHARE, _SHARE
        case "select":
            return _ZERO, _SHARE, _SHARE
        case "sin":
            return (Interval.of(-1, 1),)
        case "cos":
            return (Interval.symmetric(min(Fraction(1), operands[0].magnitude)),)
        case "sinc":
            return (Interval.symmetric(sinc_slope(operands[0].magnitude)),)
    return tuple(_ZERO for _ in expression.arguments)


def sinc_slope(magnitude: Fraction) -> Fraction:
    """Return a bound of the derivative of sin(x)/x up to a magnitude of x: |x|/3, and 1/2 anywhere."""
    return min(magnitude / 3, Fraction(1, 2))


def sensitivities(
    expressions: Expressions,
    derivatives: Sequence[tuple[Interval, ...]],
    place: int,
    held: Collection[int] = (),
) -> dict[int, Fraction]:
    """Return bounds of the derivatives of one result by all operations that it is made from.

    The chain rule is followed back from the result, so that what comes by several ways is added before its magnitude is
    taken. It stops at the places that are `held`.
    """
    adjoints = {place: _ONE}
    for k in range(place, -1, -1):
        adjoint = adjoints.get(k)
        if adjoint is None or k in held or expressions.items[k].kind in (INPUT, CONSTANT):
            continue
        for argument, slope in zip(expressions.items[k].arguments, derivatives[k], strict=True):
            part = slope if adjoint is _ONE else adjoint * slope
            known = adjoints.get(argument)
            adjoints[argument] = part if known is None else known + part
    return {k: adjoint.magnitude for k, adjoint in adjoints.items() if k not in held}
