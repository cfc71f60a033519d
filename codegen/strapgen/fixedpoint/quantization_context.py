"""`Quantization` holds the integers so far that stand for exact quantities, with their ranges and error bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.fixedpoint.format_plan import FormatPlan
from strapgen.fixedpoint.quantities import InputElement, Quantities, Quantity, Sum, used_by
from strapgen.fixedpoint.terms import up
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import ROUNDINGS, Format
from strapgen.ir.integer_program import IntegerOperation, IntegerSum, Value
from strapgen.ir.program import Program

#: Part of the smaller end of a checked range that an error may take, so that proper input passes the check.
_LARGEST_PART = Fraction(1, 2)


@dataclass
class Quantization:
    """The state of a walk over the exact quantities of a program."""

    program: Program
    settings: Settings
    quantities: Quantities
    plan: FormatPlan
    most: Mapping[str, int]  # most fraction bits of quantities that need not be finer
    feedback_names: Mapping[str, str]  # error feedbacks by the quantity whose rounding error they hand on
    word: int = field(init=False)  # bits
    rounding_error: Fraction = field(init=False)  # largest error of a rounding, in units of the last place
    values: dict[str, Value] = field(init=False)  # the integers so far, those of the inputs included
    body: list[Value] = field(default_factory=list)  # the integers so far, in the order of the code
    resets: set[str] = field(default_factory=set)  # quantities whose computed value is exact from there on
    #: Largest magnitudes in calls that pass the checks.
    checked: dict[str, Fraction] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.word, self.rounding_error = self.settings.word, ROUNDINGS[self.settings.rounding]
        self.values = dict(self.plan.values)
        self._proved: dict[str, Fraction] = {}

    def largest(self, fraction: int) -> int:
        """Return the largest integer that a word of so many fraction bits holds."""
        return Format(self.word, fraction).largest

    def size(self, name: str) -> Fraction:
        """Return the largest magnitude of a quantity in calls that pass the checks so far."""
        proved = self._proved.get(name)
        if proved is None:
            proved = self._proved[name] = self.quantities.items[name].range.magnitude
        return min(proved, self.checked.get(name, proved))

    def too_short(self, name: str) -> InputError:
        """Return the error that says that a word does not hold a quantity."""
        return InputError(f"{self.program.kernel}: words of {self.word} bits are too short for {name}")

    def add(self, value: Value) -> None:
        """Add a value to the code."""
        self.values[value.name] = value
        self.body.append(value)


def integer_value(
    context: Quantization,
    quantity: Quantity,
    definition: IntegerSum | IntegerOperation,
    fraction: int,
    error: Fraction,
    peak: int,
    wide: bool = False,
    followed: Fraction = Fraction(0),
) -> Value:
    """Return a value with the range of its integer: that of the quantity, widened by the error.

    `error` is due to rounding and to operands, `followed` to quantities that were taken as exact on the way; `peak`
    bounds every partial sum.
    """
    unit = Fraction(2) ** fraction
    local = up(error + quantity.approximation_error)
    total = local + followed
    low, high = quantity.range.lowest, quantity.range.highest
    if quantity.range_checked and total > min(abs(low), abs(high)) * _LARGEST_PART:
        _reset(context, quantity)
        total, limits = Fraction(0), (math.ceil(low * unit), math.floor(high * unit))
    elif quantity.range_checked:
        # What passes the check is so far inside that the exact value is in the range too.
        limits = (math.ceil((low + total) * unit), math.floor((high - total) * unit))
    else:
        # What was taken as exact lies in its range too, so that its error does not lead out of this one.
        limits = (math.floor((low - local) * unit), math.ceil((high + local) * unit))
    return Value(
        quantity.name,
        definition,
        fraction,
        wide,
        *limits,
        quantity.offset,
        total,
        peak,
        quantity.range_checked,
        quantity.meaning,
    )


def _reset(context: Quantization, quantity: Quantity) -> None:
    """Take the computed value as exact from here on, because nothing is known of its distance from the exact one.

    What comes after is bounded as a function of the computed value, so that it stays inside its formats; an output
    that depends on it is certified by the range of its signal alone.
    """
    items = context.quantities.items
    only_checked = all(quantity.name not in used_by(item) for item in items.values())
    # Every output has a range by what it is: an attitude.
    limited = all(r.signal.constraint and r.signal.bound is not None for r in context.program.outputs)
    if only_checked or not limited or _is_polynomial(context.quantities, quantity.name):
        raise InputError(
            f"{context.program.kernel}: words of {context.word} bits are too short for {quantity.name}, its error may "
            "be as large as itself"
        )
    context.resets.add(quantity.name)


def _is_polynomial(quantities: Quantities, name: str) -> bool:
    """Tell whether a quantity is a polynomial of the inputs, on which ranges of later ones may rest."""
    pending, seen = [name], set[str]()
    while pending:
        definition = quantities.items[pending.pop()].definition
        if isinstance(definition, Sum):
            factors = {factor for monomial, _ in definition.terms for factor in monomial}
            pending += factors - seen
            seen |= factors
        elif not isinstance(definition, InputElement):
            return False
    return True
