"""Proves the ranges of all operations of a program in exact arithmetic, anywhere in the box of the inputs."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.derived_sums import samples
from strapgen.fixedpoint.floating.errors import (
    CONSTANT,
    INPUT,
    Expression,
    Expressions,
    NoBoundError,
    exponent,
)
from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import (
    Definition,
    ExactOperation,
    InputElement,
    Quantity,
    Sum,
    Terms,
    combined,
)
from strapgen.fixedpoint.ranges import Ranges
from strapgen.ir.interfaces import Condition
from strapgen.ir.program import DOUBLE_RESOLUTION, RESOLUTION, Program

#: Resolutions of the two types.
_RESOLUTIONS = Interval.of(DOUBLE_RESOLUTION, Fraction(1, 1 << 23))
_ONE = Interval.of(-1, 1)
#: The relative error of samples, which would make limits longer numbers.
_NOISE = Fraction(1, 1 << 20)

_Samples = NDArray[np.float64] | np.float64
#: The functions of operations on samples.
_ON_SAMPLES: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "negate": np.negative,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "sinc": lambda x: np.sinc(x / np.pi),
    "maximum": np.maximum,
    "at_least": np.greater_equal,
    "select": np.where,
}
#: A magnitude on samples above every range.
_NO_BIT_TO_GAIN = 2.0**1000
_SUMS = ("add", "subtract", "multiply", "negate")

#: Of a quantity whose range alone is known.
_UNKNOWN = ExactOperation("maximum", ())


@dataclass
class ExactRanges:
    """The range of every operation; NoBoundError where one is not defined everywhere in the box, or jumps."""

    program: Program
    expressions: Expressions
    box: Mapping[str, Interval]  # range of every element of an input
    sharp: Container[int] | None = None  # places whose ranges lose no bit; None for all
    ranges: list[Interval] = field(default_factory=list)
    conditions: list[Condition] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._items: dict[str, Quantity] = {}
        self._proofs = Ranges(self._items, self.box)
        self._proper: list[_Samples] = []
        self._anywhere: list[_Samples] = []
        self._inputs = samples(self.program.inputs, self.box)
        with np.errstate(all="ignore"):  # samples are hints: what is not finite hints at nothing
            for place, expression in enumerate(self.expressions.items):
                self._add_samples(expression)
                self.ranges.append(self._range(place, expression))

    def _add_samples(self, expression: Expression) -> None:
        for values, inputs in zip((self._proper, self._anywhere), self._inputs, strict=True):
            if expression.kind == INPUT:
                values.append(inputs.get(expression.name, np.float64(DOUBLE_RESOLUTION)))
            elif expression.kind == CONSTANT:
                values.append(np.float64(expression.value))
            elif expression.kind not in _ON_SAMPLES:
                raise NoBoundError(f"{expression.kind} jumps by a turn")
            else:
                values.append(_ON_SAMPLES[expression.kind](*(values[k] for k in expression.arguments)))

    def _range(self, place: int, expression: Expression) -> Interval:
        """Return the range of an operation, and note it for the proofs that follow."""
        name = self._name(place)
        if expression.kind == CONSTANT:
            return Interval.of(expression.value)
        if expression.kind == INPUT:
            known = _RESOLUTIONS if expression.name == RESOLUTION else self.box[expression.name]
            self._items[name] = Quantity(name, InputElement(expression.name), Fraction(0), known)
            return known
        if expression.kind in _SUMS:
            terms = self._terms(expression)
            seen = float(np.nan_to_num(np.abs(self._anywhere[place]), posinf=0).max()) or 1e-300
            if self.sharp is not None and place not in self.sharp:
                seen = _NO_BIT_TO_GAIN
            known = self._proofs.of_sum(name, terms, seen)
            if remainder := self.expressions.remainders.get(place):
                known = known.widened(remainder)
                self._note(name, _UNKNOWN, known)
                return known
            self._items[name] = Quantity(name, Sum(tuple(terms.items())), Fraction(0), known)
            return known
        known = self._function_range(place, expression)
        self._note(name, _UNKNOWN, known)
        return known

    def _name(self, place: int) -> str:
        return self.expressions.items[place].name or f"#{place}"

    def _note(self, name: str, definition: Definition, known: Interval) -> None:
        self._items[name] = Quantity(name, definition, Fraction(0), known)
        self._proofs.expanded[name] = None

    def _terms(self, expression: Expression) -> Terms:
        """Return a sum or a product as terms of its operands."""
        first, *rest = (self._operand(k) for k in expression.arguments)
        if expression.kind == "negate":
            return combined({}, first, Fraction(-1))
        (second,) = rest
        if expression.kind != "multiply":
            return combined(first, second, Fraction(1 if expression.kind == "add" else -1))
        return {a + b: c * d for a, c in first.items() for b, d in second.items()}

    def _operand(self, place: int) -> Terms:
        expression = self.expressions.items[place]
        if expression.kind == CONSTANT:
            return {(): expression.value} if expression.value else {}
        return {(self._name(place),): Fraction(1)}

    def _function_range(self, place: int, expression: Expression) -> Interval:
        """Return the range of an operation that is no sum and no product."""
        kind, places = expression.kind, expression.arguments
        label = self.expressions.labels[place]
        if kind == "divide":
            divisor = self._kept_from_zero(places[1], f"the divisor in {label}")
            if divisor.low <= 0 <= divisor.high:
                raise NoBoundError(f"the divisor in {label} may be zero")
            return self.ranges[places[0]] * divisor.reciprocal()
        if kind == "sqrt":
            radicand = self._kept_from_zero(places[0], f"the radicand in {label}")
            if radicand.low < 0:
                raise NoBoundError(f"the radicand in {label} may be below zero")
            return radicand.sqrt()
        ranges = [self.ranges[k] for k in places]
        if kind == "maximum":
            return maximum(ranges)
        if kind == "select":
            return ranges[1].join(ranges[2])
        if kind == "at_least":
            return Interval.of(0, 1)
        if kind == "sin":
            return Interval.symmetric(ranges[0].magnitude).meet(_ONE)
        if kind == "cos":
            return _cosine(ranges[0].magnitude, Fraction(1, 2))
        return _cosine(ranges[0].magnitude, Fraction(1, 6))  # sinc(x) >= 1 - x^2/6

    def _kept_from_zero(self, place: int, label: str) -> Interval:
        """Return the range of a divisor or a radicand, if need be by a condition near its range on proper inputs."""
        known = self.ranges[place]
        proper = _near(np.atleast_1d(self._proper[place]))
        if proper is not None and (known.low <= 0 <= known.high or proper.low > 2 * known.low > 0):
            self.conditions.append(Condition(label, proper.lowest, proper.highest))
            self._narrow(place, proper)
            for k in self.expressions.squared(place):  # no square is above the sum of all
                self._narrow(k, Interval.symmetric(proper.sqrt().highest))
        return self.ranges[place]

    def _narrow(self, place: int, limits: Interval) -> None:
        self.ranges[place] = known = self.ranges[place].meet(limits)
        name = self._name(place)
        definition = self._items[name].definition
        self._note(name, definition if isinstance(definition, InputElement) else _UNKNOWN, known)


def _cosine(magnitude: Fraction, curvature: Fraction) -> Interval:
    """Return the range of an even function of at least 1 - curvature x^2, between -1 and 1."""
    return Interval.of(max(Fraction(-1), 1 - curvature * magnitude * magnitude), 1)


def _near(values: NDArray[np.float64]) -> Interval | None:
    """Return the range from 3/4 of the smallest to 4/3 of the largest of some values, for short numbers a bit more.

    None where they are not finite, have both signs or come near zero.
    """
    least, most = float(np.abs(values).min()), float(np.abs(values).max())
    one_sign = bool((values > 0).all() or (values < 0).all())
    if not math.isfinite(most) or not one_sign or least < most / 64:
        return None
    unit = Fraction(2) ** (exponent(Fraction(least)) - 5)
    positive = Interval.of(
        math.floor(Fraction(least) * (1 + _NOISE) * 3 / 4 / unit) * unit,
        math.ceil(Fraction(most) * (1 - _NOISE) * 4 / 3 / unit) * unit,
    )
    return positive if values[0] > 0 else -positive
