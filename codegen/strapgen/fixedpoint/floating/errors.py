"""Bounds the computed numbers of generated code: their ranges, the rounding of every operation, its error.

The error e of an operation f on operands with errors obeys e = f' e_operands + q + r at the exact values: r is its
rounding, and q, of second order, is what the derivative f' leaves out. Only r and q are new at an operation.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

from strapgen.fixedpoint.intervals import GRID, Interval, maximum, root
from strapgen.fixedpoint.quantities import binary, is_power_of_two, up
from strapgen.ir.program import RESOLUTION, Constant, Node, Program, Reference

_ZERO = Fraction(0)


INPUT, CONSTANT = "input", "constant"


class NoBoundError(Exception):
    """No bound of the rounding can be proved; the text says why."""


@dataclass(frozen=True)
class Expression:
    """A single operation, a literal or an element of an input."""

    kind: str  # an operation of `strapgen.ir.program.OPERATIONS`, `INPUT` or `CONSTANT`
    arguments: tuple[int, ...] = ()  # places of the operands
    name: str = ""  # name of an element of an input
    value: Fraction = Fraction(0)  # value of a literal


@dataclass
class Expressions:
    """The operations of a program, each after its operands."""

    items: list[Expression] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)  # places of elements of inputs and of assignments
    labels: dict[int, str] = field(default_factory=dict)  # assignments in which operations stand
    results: dict[str, list[int]] = field(default_factory=dict)  # places of the elements of every result
    remainders: dict[int, Fraction] = field(default_factory=dict)  # of series, at the places of their values
    _places: dict[Expression, int] = field(default_factory=dict)

    @classmethod
    def of(cls, program: Program) -> Expressions:
        """Return the operations of a program."""
        flat = cls()
        for name in [*(name for signal in program.inputs for name in signal.elements), RESOLUTION]:
            flat.names[name] = flat._place(Expression(INPUT, name=name), name)
        for assignment in program.body:
            place = flat.names[assignment.name] = flat.place_of(assignment.value, assignment.name)
            if assignment.remainder:
                flat.remainders[place] = max(assignment.remainder, flat.remainders.get(place, _ZERO))
        for result in program.results:
            name = result.signal.name
            flat.results[name] = [flat.place_of(node, name) for node in result.nodes]
        return flat

    def place_of(self, node: Node, label: str = "") -> int:
        """Return the place of a node, with its operations added where they are new."""
        if isinstance(node, Reference):
            return self.names[node.name]
        if isinstance(node, Constant):
            return self._place(Expression(CONSTANT, value=node.value), label)
        arguments = tuple(self.place_of(argument, label) for argument in node.arguments)
        return self._place(Expression(node.kind, arguments), label)

    def squared(self, place: int) -> list[int]:
        """Return the places of the numbers of whose squares an operation is the sum; none if it is no such sum."""
        expression = self.items[place]
        if expression.kind == "add":
            parts = [self.squared(k) for k in expression.arguments]
            return [k for part in parts for k in part] if all(parts) else []
        is_square = expression.kind == "multiply" and len({*expression.arguments}) == 1
        return [expression.arguments[0]] if is_square else []

    def _place(self, expression: Expression, label: str) -> int:
        place = self._places.setdefault(expression, len(self.items))
        if place == len(self.items):
            self.items.append(expression)
            self.labels[place] = label
        return place


@dataclass(frozen=True)
class NumberFormat:
    """A binary floating-point format of IEEE 754.

    >>> NUMBERS["float"].rounded(Fraction(1, 3)) * 2**25
    Fraction(11184811, 1)
    """

    precision: int  # bits of the significand, the leading one included
    smallest: int  # exponent of the smallest positive number: 2**smallest
    overflow: int  # exponent of the power of two that all numbers are below

    @property
    def unit(self) -> Fraction:
        """Half the distance from 1 to the next number: the largest relative error of a rounding."""
        return Fraction(1, 1 << self.precision)

    @property
    def underflow(self) -> Fraction:
        """Half the smallest number: the largest error of a rounding near zero."""
        return _power_of_two(self.smallest - 1)

    def rounded(self, value: Fraction) -> Fraction:
        """Return the nearest number, of two the even one, as a literal is read."""
        if not value:
            return value
        place = max(exponent(abs(value)) - self.precision + 1, self.smallest)
        steps = round(binary(value.numerator, place) / value.denominator)
        return binary(steps, -place)

    def half_ulp(self, largest: Fraction) -> Fraction:
        """Return the largest error of rounding a number of at most this magnitude.

        Just above a power of two no number is farther from the nearest one than from that power.

        >>> NUMBERS["double"].half_ulp(Fraction(1)) * 2**54
        Fraction(1, 1)
        """
        if not largest:
            return Fraction(0)
        power = exponent(largest)
        above = largest - _power_of_two(power)
        half = _power_of_two(power - self.precision)
        return max(half / 2, min(half, above), self.underflow)

    def ulp(self, largest: Fraction) -> Fraction:
        """Return a unit in the last place of numbers of at most this magnitude: of a power of two, that below it."""
        if not largest:
            return Fraction(2) ** self.smallest
        power = exponent(largest)
        unit = Fraction(2) ** max(power - self.precision + 1, self.smallest)
        return unit if largest > Fraction(2) ** power else max(unit / 2, 2 * self.underflow)


#: The formats by the name of their type in C.
NUMBERS = {"double": NumberFormat(53, -1074, 1024), "float": NumberFormat(24, -149, 128)}


def exponent(value: Fraction) -> int:
    """Return the exponent of the largest power of two that is not above a positive number.

    >>> exponent(Fraction(5, 16)), exponent(Fraction(8))
    (-2, 3)
    """
    top, bottom = value.numerator, value.denominator
    power = top.bit_length() - bottom.bit_length()
    return power if top << max(0, -power) >= bottom << max(0, power) else power - 1


@lru_cache(maxsize=4096)
def _power_of_two(power: int) -> Fraction:
    """Return a power of two."""
    return binary(1, -power)


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
            self.items.append(self._compute(place, expression))

    def _compute(self, place: int, expression: Expression) -> _ComputedNumber:
        exact = self.ranges[place]
        if expression.kind == INPUT:
            return _ComputedNumber(exact, _ZERO, _ZERO, relative=(_ZERO, _ZERO))
        if expression.kind == CONSTANT:
            return self._literal(expression.value)
        carried, second = self._propagate(place, expression)
        left_out = up(self.expressions.remainders.get(place, _ZERO))
        carried, second = carried + left_out, second + left_out
        before = self._before_rounding(expression).meet(exact.widened(carried))
        rounding = self._rounding(expression, before)
        after = before.widened(rounding).meet(self._round(before, expression.kind))
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

    def _propagate(self, place: int, expression: Expression) -> tuple[Fraction, Fraction]:
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
                return self._divide(place, expression)
            case "sqrt":
                return self._square_root(place, expression)
            case "sin" | "cos":
                return errors[0], up(errors[0] * errors[0] / 2)
            case "sinc":
                x = self.ranges[expression.arguments[0]].magnitude + errors[0]
                return up(errors[0] * _sinc_slope(x)), up(errors[0] * errors[0] / 6)
            case "maximum":
                return max(errors), _ZERO
            case "select":
                self._check_comparison(expression.arguments[0], place)
                return max(errors[1:]), _ZERO
        return _ZERO, _ZERO  # a comparison, which a selection looks into

    def _divide(self, place: int, expression: Expression) -> tuple[Fraction, Fraction]:
        numerator, divisor = (self.items[k] for k in expression.arguments)
        exact = least_magnitude(self.ranges[expression.arguments[1]])
        computed = least_magnitude(divisor.range)
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
        """Return whether an operation rounds nothing."""
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

    def _round(self, before: Interval, kind: str) -> Interval:
        """Return the range after rounding, which keeps the order of numbers; functions are not rounded so."""
        if kind in ("sin", "cos", "sinc"):
            return before.widened(Fraction(1, 4))
        return Interval.of(self.number.rounded(before.lowest), self.number.rounded(before.highest))

    def _places(self, expression: Expression, computed: Interval) -> int | None:
        """Return the exponent of a power of two that divides the computed numbers; None where they come near zero."""
        least = least_magnitude(computed)
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


def least_magnitude(interval: Interval) -> Fraction:
    """Return the smallest magnitude of a number inside."""
    if interval.low <= 0 <= interval.high:
        return _ZERO
    return Fraction(min(abs(interval.low), abs(interval.high)), 1 << GRID)


def _root_share(share: Fraction) -> Fraction:
    """Return a bound of the relative error of a root, from that of its radicand, which is at most 1/2."""
    return share / 2 + share * share / 2 if share <= Fraction(1, 2) else share


_NO_SLOPE = Interval(0, 0)
_SLOPE_ONE = Interval.of(1)
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
            return _SLOPE_ONE, _SLOPE_ONE
        case "subtract":
            return _SLOPE_ONE, -_SLOPE_ONE
        case "negate":
            return (-_SLOPE_ONE,)
        case "multiply":
            return operands[1], operands[0]
        case "divide":
            inverse = operands[1].reciprocal()
            return inverse, -(value * inverse)
        case "sqrt":
            return (value.scale(Fraction(2)).reciprocal() if value.low > 0 else _NO_SLOPE,)
        case "maximum":
            return _SHARE, _SHARE
        case "select":
            return _NO_SLOPE, _SHARE, _SHARE
        case "sin":
            return (Interval.of(-1, 1),)
        case "cos":
            return (Interval.symmetric(min(Fraction(1), operands[0].magnitude)),)
        case "sinc":
            return (Interval.symmetric(_sinc_slope(operands[0].magnitude)),)
    return tuple(_NO_SLOPE for _ in expression.arguments)


def _sinc_slope(magnitude: Fraction) -> Fraction:
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
    adjoints = {place: _SLOPE_ONE}
    for k in range(place, -1, -1):
        adjoint = adjoints.get(k)
        if adjoint is None or k in held or expressions.items[k].kind in (INPUT, CONSTANT):
            continue
        for argument, slope in zip(expressions.items[k].arguments, derivatives[k], strict=True):
            part = slope if adjoint is _SLOPE_ONE else adjoint * slope
            known = adjoints.get(argument)
            adjoints[argument] = part if known is None else known + part
    return {k: adjoint.magnitude for k, adjoint in adjoints.items() if k not in held}
