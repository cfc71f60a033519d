"""Bounds the computed numbers of generated code: their ranges, the rounding of every operation, its error.

The error e of an operation f on operands with errors obeys e = f' e_operands + q + r at the exact values: r is its
rounding, and q, of second order, is what the derivative f' leaves out. Only r and q are new at an operation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.fixedpoint.floating.expressions import CONSTANT, INPUT, Expression, Expressions, NoBoundError
from strapgen.fixedpoint.floating.number_formats import NumberFormat, exponent
from strapgen.fixedpoint.floating.sensitivities import sinc_slope
from strapgen.fixedpoint.intervals import GRID, Interval, maximum, root
from strapgen.fixedpoint.quantities import is_power_of_two
from strapgen.fixedpoint.terms import up

_ZERO = Fraction(0)


@dataclass(frozen=True)
class _ComputedNumber:
    """The number that the code computes for an operation."""

    range: Interval  # range of the computed number
    error: Fraction  # bound of its distance from the exact value
    added: Fraction  # the new part of the error: r and q
    places: int | None = None  # the number is a multiple of 2**places, if that is known
    #: a, b: the distance is at most a times the exact value plus b, if that is known.
    relative: tuple[Fraction, Fraction] | None = None


def added_errors(
    expressions: Expressions, ranges: Sequence[Interval], number: NumberFormat
) -> list[Fraction]:
    """Return the new part of every operation's error; NoBoundError for an overflow, or a comparison that may turn."""
    return [item.added for item in _ComputedNumbers(expressions, ranges, number).items]


@dataclass
class _ComputedNumbers:
    """The computed numbers of all operations."""

    expressions: Expressions
    ranges: Sequence[Interval]  # exact range of every operation
    number: NumberFormat
    items: list[_ComputedNumber] = field(default_factory=list)

    def __post_init__(self) -> None:
        for place, expression in enumerate(self.expressions.items):
            self.items.append(self._computed(place, expression))

    def _computed(self, place: int, expression: Expression) -> _ComputedNumber:
        exact = self.ranges[place]
        if expression.kind == INPUT:
            return _ComputedNumber(exact, _ZERO, _ZERO, relative=(_ZERO, _ZERO))
        if expression.kind == CONSTANT:
            return self._literal(expression.value)
        carried, second = self._propagated(place, expression)
        before = self._before_rounding(expression).meet(exact.widened(carried))
        rounding = self._rounding(expression, before)
        after = before.widened(rounding).meet(self._rounded(before, expression.kind))
        if after.magnitude >= Fraction(2) ** self.number.overflow:
            raise NoBoundError(f"{self.expressions.labels[place]} may overflow")
        return _ComputedNumber(
            after,
            up(carried + rounding),
            up(second + rounding),
            self._places(expression, after),
            self._relative(place, expression, rounding),
        )

    def _literal(self, value: Fraction) -> _ComputedNumber:
        near = self.number.rounded(value)
        error = up(abs(near - value))
        relative = (error / value, _ZERO) if value > 0 else None
        return _ComputedNumber(Interval.of(near), error, error, _lowest_bit(near), relative)

    # Errors of operands

    def _propagated(self, place: int, expression: Expression) -> tuple[Fraction, Fraction]:
        """Return the error that those of the operands make in an operation, and its part of second order."""
        operands = [self.items[k] for k in expression.arguments]
        errors = [operand.error for operand in operands]
        match expression.kind:
            case "add" | "subtract" | "negate":
                return sum(errors, _ZERO), _ZERO
            case "multiply":
                x, y = (self.ranges[k].magnitude for k in expression.arguments)
                second = up(errors[0] * errors[1])
                return up(x * errors[1] + y * errors[0]) + second, second
            case "divide":
                return self._divided(place, expression)
            case "sqrt":
                return self._square_root(place, expression)
            case "sin" | "cos":
                return errors[0], up(errors[0] * errors[0] / 2)
            case "sinc":
                x = self.ranges[expression.arguments[0]].magnitude + errors[0]
                return up(errors[0] * sinc_slope(x)), up(errors[0] * errors[0] / 6)
            case "maximum":
                return max(errors), _ZERO
            case "select":
                self._check_comparison(expression.arguments[0], place)
                return max(errors[1:]), _ZERO
        return _ZERO, _ZERO  # a comparison, which a selection looks into

    def _divided(self, place: int, expression: Expression) -> tuple[Fraction, Fraction]:
        numerator, divisor = (self.items[k] for k in expression.arguments)
        exact = _least_magnitude(self.ranges[expression.arguments[1]])
        computed = _least_magnitude(divisor.range)
        if not exact or not computed:
            raise NoBoundError(f"the divisor in {self.expressions.labels[place]} may be computed as zero")
        change = numerator.error + self.ranges[place].magnitude * divisor.error
        return up(change / computed), up(change * divisor.error / (exact * computed))

    def _square_root(self, place: int, expression: Expression) -> tuple[Fraction, Fraction]:
        (argument,) = expression.arguments
        radicand, exact = self.items[argument], self.ranges[place]
        if radicand.range.low < 0:
            raise NoBoundError(f"the radicand in {self.expressions.labels[place]} may be computed below zero")
        least, computed = exact.lowest, radicand.range.sqrt().lowest
        if least and not computed:
            raise NoBoundError(f"the radicand in {self.expressions.labels[place]} may be computed as zero")
        if least:
            error = radicand.error
            return (
                up(error / (least + computed)),
                up(error * error / (2 * least * (least + computed) ** 2)),
            )
        error = root(radicand.error)
        if radicand.relative is not None:
            share, rest = radicand.relative
            error = min(error, up(_root_share(share) * exact.magnitude) + root(rest))
        return error, error

    def _check_comparison(self, condition: int, place: int) -> None:
        """Refuse a comparison that rounding may turn."""
        expression = self.expressions.items[condition]
        if expression.kind == "at_least":
            left, right = (self.items[k] for k in expression.arguments)
            if not left.error and not right.error:
                return
            exact_left, exact_right = (self.ranges[k] for k in expression.arguments)
            computed, exact = left.range - right.range, exact_left - exact_right
            if min(computed.low, exact.low) >= 0 or max(computed.high, exact.high) < 0:
                return
        raise NoBoundError(f"rounding may turn a comparison in {self.expressions.labels[place]}")

    # Rounding

    def _before_rounding(self, expression: Expression) -> Interval:
        """Return the range of an operation on computed numbers, before it is rounded."""
        operands = [self.items[k].range for k in expression.arguments]
        match expression.kind:
            case "add":
                return operands[0] + operands[1]
            case "subtract":
                return operands[0] - operands[1]
            case "negate":
                return -operands[0]
            case "multiply":
                same = expression.arguments[0] == expression.arguments[1]
                return operands[0].square() if same else operands[0] * operands[1]
            case "divide":
                return operands[0] * operands[1].reciprocal()
            case "sqrt":
                return operands[0].sqrt()
            case "maximum":
                return maximum(operands)
            case "select":
                return operands[1].join(operands[2])
        return Interval.of(-1, 1)  # sin, cos, sin(x)/x, a comparison

    def _rounding(self, expression: Expression, before: Interval) -> Fraction:
        """Return a bound of the rounding error of an operation whose result lies in a range before it is rounded."""
        largest = before.magnitude
        if expression.kind in ("sin", "cos"):  # within one unit in the last place
            return up(self.number.ulp(largest))
        if expression.kind == "sinc":
            sine = 2 * self.number.unit
            return up(sine + self.number.half_ulp(1 + sine))
        if self._is_exact(expression, before):
            return _ZERO
        if self._scales(expression):
            return up(self.number.underflow)
        return up(self.number.half_ulp(largest))

    def _is_exact(self, expression: Expression, before: Interval) -> bool:
        """Tell whether an operation rounds nothing."""
        if expression.kind in ("negate", "maximum", "select", "at_least"):
            return True
        if expression.kind in ("add", "subtract"):
            if expression.arguments[0] == expression.arguments[1]:
                return True
            places = self._common_place(expression)
            return places is not None and before.magnitude <= Fraction(2) ** (places + self.number.precision)
        factor = self._scales(expression)
        return factor is not None and factor >= 1

    def _scales(self, expression: Expression) -> Fraction | None:
        """Return the power of two by which an operation multiplies; None if it does something else."""
        constants = [
            (k, self.number.rounded(self.expressions.items[place].value))
            for k, place in enumerate(expression.arguments)
            if self.expressions.items[place].kind == CONSTANT
        ]
        powers = [(k, value) for k, value in constants if value and is_power_of_two(value)]
        if expression.kind == "multiply" and powers:
            return abs(powers[0][1])
        if expression.kind == "divide" and powers and powers[-1][0] == 1:
            return 1 / abs(powers[-1][1])
        return None

    def _rounded(self, before: Interval, kind: str) -> Interval:
        """Return the range after rounding, which keeps the order of numbers; functions are not rounded so."""
        if kind in ("sin", "cos", "sinc"):
            return before.widened(Fraction(1, 4))
        return Interval.of(self.number.rounded(before.lowest), self.number.rounded(before.highest))

    def _places(self, expression: Expression, computed: Interval) -> int | None:
        """Return the exponent of a power of two that divides the computed numbers; None where they come near zero."""
        least = _least_magnitude(computed)
        candidates = [exponent(least) - self.number.precision + 1] if least else []
        common = self._common_place(expression)
        return max(candidates if common is None else [common, *candidates], default=None)

    def _common_place(self, expression: Expression) -> int | None:
        """Return the exponent of a power of two that divides both operands of a sum."""
        places = [self.items[k].places for k in expression.arguments]
        if expression.kind not in ("add", "subtract", "negate"):
            return None
        return None if None in places else min(place for place in places if place is not None)

    # Relative errors, for what lies under a root that may be zero

    def _relative(
        self, place: int, expression: Expression, rounding: Fraction
    ) -> tuple[Fraction, Fraction] | None:
        """Return bounds of the error relative to the exact value, for products and sums of no negative numbers."""
        known = [self.items[k].relative for k in expression.arguments]
        if any(pair is None for pair in known) or expression.kind not in ("multiply", "add"):
            return None
        (a, b), (c, d) = (pair for pair in known if pair is not None)
        if expression.kind == "add":
            if any(self.ranges[k].low < 0 for k in expression.arguments):
                return None
            share, rest = max(a, c), b + d
        else:
            x, y = (self.ranges[k].magnitude + self.items[k].error for k in expression.arguments)
            share, rest = a + c + a * c, x * d + y * b + b * d
        if not rounding:
            return up(share), up(rest)
        unit = self.number.unit
        return up(share + unit + share * unit), up(rest + rest * unit + self.number.underflow)


def _lowest_bit(value: Fraction) -> int | None:
    """Return the exponent of the lowest bit of a dyadic number; None for zero."""
    if not value:
        return None
    top = abs(value.numerator)
    return (top & -top).bit_length() - value.denominator.bit_length()


def _least_magnitude(interval: Interval) -> Fraction:
    """Return the smallest magnitude of a number inside."""
    if interval.low <= 0 <= interval.high:
        return _ZERO
    return Fraction(min(abs(interval.low), abs(interval.high)), 1 << GRID)


def _root_share(share: Fraction) -> Fraction:
    """Return a bound of the relative error of a root, from that of its radicand, which is at most 1/2."""
    return share / 2 + share * share / 2 if share <= Fraction(1, 2) else share
