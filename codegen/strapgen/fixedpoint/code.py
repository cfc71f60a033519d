"""Fixed-point programs: straight-line code on integers, with a proved range and error bound for every value.

A word holds `word` bits, a wide number twice as many. Sums of products are exact in wide numbers and are rounded once.
Nothing here knows C or Python text; targets print it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from typing import Any

from strapgen.fixedpoint.formats import Format
from strapgen.fixedpoint.settings import Settings
from strapgen.program import Program
from strapgen.signal import Signal


@dataclass(frozen=True)
class Term:
    """``factor * product of values * 2**shift``, an integer; a shift below zero rounds down.

    Parameters
    ----------
    names : tuple of str
        Up to two values; two are words.
    factor : int
        Not zero; 1 or -1 with two values.
    shift : int
    """

    names: tuple[str, ...]
    factor: int
    shift: int = 0


@dataclass(frozen=True)
class ErrorFeedback:
    """What lies below the last place of a value, kept for the next call: a word without a sign.

    It takes the place of what is added for rounding: the sum starts from it, and its low bits are the next one. A fresh
    start is half a unit of the last place for rounding to the nearest, and nothing for truncation; every other word is
    allowed too.

    Parameters
    ----------
    name : str
        Its name.
    fraction : int
        Its fraction bits.
    shift : int
        From its fraction to that of the sum, not above 0: added as ``residual * 2**shift``, which drops bits.
    fresh : int
        The word of a fresh start.
    """

    name: str
    fraction: int
    shift: int
    fresh: int


@dataclass(frozen=True)
class IntegerInput:
    """An element of an input."""


@dataclass(frozen=True)
class IntegerSum:
    """Terms, divided by 2**shift with rounding, and terms that are added after that.

    Parameters
    ----------
    fine : tuple of Term
        What is rounded, or all of it where nothing is.
    shift : int
        Places that the rounding drops, 0 for none.
    coarse : tuple of Term
        What is exact at the result's own fraction.
    residual : ErrorFeedback or None
        What the rounding of the last call left; it is added in place of half a unit.
    drop : int
        Places below the last one of the residual, which are dropped before it is added.
    """

    fine: tuple[Term, ...]
    shift: int = 0
    coarse: tuple[Term, ...] = ()
    residual: ErrorFeedback | None = None
    drop: int = 0


@dataclass(frozen=True)
class Scaled:
    """A value or an integer constant, times 2**shift."""

    value: str | int
    shift: int = 0


@dataclass(frozen=True)
class IntegerQuotient:
    """``numerator / denominator``, rounded; the denominator has one sign."""

    numerator: Scaled
    denominator: str


@dataclass(frozen=True)
class IntegerRoot:
    """The square root of an integer that is not negative, rounded."""

    argument: Scaled


@dataclass(frozen=True)
class IntegerMaximum:
    """The largest of several."""

    arguments: tuple[Scaled, ...]


@dataclass(frozen=True)
class IntegerSelection:
    """The value of the first case whose left side is at least its right side, or another one.

    The two sides of a case have one fraction, and so have all values.
    """

    cases: tuple[tuple[Scaled, Scaled, Scaled], ...]
    otherwise: Scaled


IntegerDefinition = (
    IntegerInput | IntegerSum | IntegerQuotient | IntegerRoot | IntegerMaximum | IntegerSelection
)


@dataclass(frozen=True)
class Value:
    """An integer of a fixed-point program: it stands for ``offset + integer * 2**-fraction``.

    Parameters
    ----------
    name : str
    definition : IntegerDefinition
    fraction : int
    wide : bool
        Whether it takes a wide number.
    low, high : int
        Proved range of the integer.
    offset : Fraction
        Constant that is not stored.
    error : Fraction
        Bound of its distance from the exact value, in units of the value.
    peak : int
        Bound of the magnitude of every partial sum on the way to it.
    guarded : bool
        Whether the range is checked when the code runs; what lies outside is refused.
    meaning : str
        Said where a named stage of the algorithm begins.
    """

    name: str
    definition: IntegerDefinition
    fraction: int
    wide: bool
    low: int
    high: int
    offset: Fraction
    error: Fraction
    peak: int
    guarded: bool = False
    meaning: str = ""

    @property
    def magnitude(self) -> int:
        """Largest magnitude of the integer."""
        return max(abs(self.low), abs(self.high))


def used_by(value: Value) -> list[str]:
    """Return the names that a value is computed from."""
    definition = value.definition
    if isinstance(definition, IntegerSum):
        return [name for term in (*definition.fine, *definition.coarse) for name in term.names]
    if isinstance(definition, IntegerQuotient):
        return [definition.denominator, *_named([definition.numerator])]
    if isinstance(definition, IntegerRoot):
        return _named([definition.argument])
    if isinstance(definition, IntegerMaximum):
        return _named(definition.arguments)
    if not isinstance(definition, IntegerSelection):
        return []
    return _named([side for case in definition.cases for side in case] + [definition.otherwise])


def _named(operands: tuple[Scaled, ...] | list[Scaled]) -> list[str]:
    return [operand.value for operand in operands if isinstance(operand.value, str)]


@dataclass(frozen=True)
class Argument:
    """An input or an output of a fixed-point function.

    Parameters
    ----------
    signal : Signal
    format : Format
    values : tuple of str
        The value that holds each element.
    low, high : int
        Range of the integers: of an input, what is accepted; of an output, what is proved.
    errors : tuple of Fraction
        Error bound of each element of an output after one call; of an input, zeros.
    """

    signal: Signal
    format: Format
    values: tuple[str, ...]
    low: int
    high: int
    errors: tuple[Fraction, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the argument as plain JSON data."""
        return {
            "signal": self.signal.as_dict(),
            "word": self.format.word,
            "fraction": self.format.fraction,
            "values": list(self.values),
            "low": self.low,
            "high": self.high,
            "errors": [str(error) for error in self.errors],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Argument:
        """Rebuild an argument from `as_dict`."""
        return cls(
            Signal.from_dict(data["signal"]),
            Format(data["word"], data["fraction"]),
            tuple(data["values"]),
            data["low"],
            data["high"],
            tuple(map(Fraction, data["errors"])),
        )


@dataclass(frozen=True)
class RoundingAccumulation:
    """How rounding adds up over the steps of a run, in the length of a state (of a row, for a matrix).

    Parameters
    ----------
    once : Fraction
        What does not depend on the number of steps.
    per_step : Fraction
        What every step adds.
    input_rounding : Fraction
        What every step adds if increments are rounded to their format first.
    growth : Fraction
        Largest factor by which a step stretches what is there.
    """

    once: Fraction
    per_step: Fraction
    input_rounding: Fraction
    growth: Fraction

    def bound(self, steps: int, rounded_inputs: bool = False, stretch: float | None = None) -> float:
        """Return a bound after a number of steps; inf where none of use is known.

        Parameters
        ----------
        steps : int
        rounded_inputs : bool, optional
            Whether increments are rounded to their format first.
        stretch : float, optional
            Largest factor by which the transitions of the run stretch a difference, where more is known of it than
            that no step exceeds `growth`.

        Examples
        --------
        >>> RoundingAccumulation(Fraction(1), Fraction(2), Fraction(0), Fraction(1)).bound(10)
        21.0
        """
        exponent = steps * float(self.growth - 1)
        if exponent > 100 and stretch is None:
            return math.inf
        exponent = min(exponent, 100.0)
        per_step = self.per_step + (self.input_rounding if rounded_inputs else 0)
        # (g^n - 1)/(g - 1) <= n exp(n (g - 1)); a part in a million covers the rounding of this line.
        stretched = math.exp(exponent) * (1 + 1e-6) if exponent else 1.0
        if stretch is not None:
            stretched = stretch
        return stretched * (float(self.once) + steps * float(per_step))


@dataclass(frozen=True)
class Interface:
    """All that a caller of fixed-point code must know.

    Parameters
    ----------
    settings : Settings
    inputs, outputs : tuple of Argument
    residuals : tuple of ErrorFeedback
        What is kept from call to call.
    accumulation : RoundingAccumulation or None
        For a step, how its rounding adds up.
    """

    settings: Settings
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    residuals: tuple[ErrorFeedback, ...]
    accumulation: RoundingAccumulation | None

    @property
    def companion_settings(self) -> Settings:
        """The settings of a kernel that works on the same state beside a step: an orthonormalization."""
        return replace(self.settings, ranges={}, formats={"state": str(self.inputs[0].format)})

    def as_dict(self) -> dict[str, Any]:
        """Return the interface as plain JSON data."""
        adds_up = self.accumulation
        return {
            "settings": self.settings.as_dict(),
            "inputs": [argument.as_dict() for argument in self.inputs],
            "outputs": [argument.as_dict() for argument in self.outputs],
            "residuals": [asdict(residual) for residual in self.residuals],
            "accumulation": adds_up and {name: str(value) for name, value in asdict(adds_up).items()},
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Interface:
        """Rebuild an interface from `as_dict`."""
        adds_up = data["accumulation"]
        return cls(
            Settings.from_dict(data["settings"]),
            tuple(map(Argument.from_dict, data["inputs"])),
            tuple(map(Argument.from_dict, data["outputs"])),
            tuple(ErrorFeedback(**residual) for residual in data["residuals"]),
            adds_up and RoundingAccumulation(**{name: Fraction(value) for name, value in adds_up.items()}),
        )


@dataclass(frozen=True)
class FixedProgram:
    """Straight-line code on integers for one kernel.

    Parameters
    ----------
    program : Program
        What it was lowered from.
    interface : Interface
    body : tuple of Value
        The code.
    operations : dict of str to int
        Integer operations of one call.
    """

    program: Program
    interface: Interface
    body: tuple[Value, ...]
    operations: dict[str, int]

    @property
    def word(self) -> int:
        """Bits of a word."""
        return self.interface.settings.word

    @property
    def name(self) -> str:
        """Name in generated code."""
        return f"{self.program.name}_q{self.word - 1}"

    @property
    def temporaries(self) -> int:
        """Number of values that are not elements of an output."""
        held = {name for argument in self.interface.outputs for name in argument.values}
        return sum(value.name not in held for value in self.body)

    @property
    def formats(self) -> dict[str, Format]:
        """Format of every argument and word, by name; of a wide number with its length."""
        known = {a.signal.name: a.format for a in (*self.interface.inputs, *self.interface.outputs)}
        return known | {v.name: Format(self.word * (1 + v.wide), v.fraction) for v in self.body}

    @property
    def ranges(self) -> dict[str, tuple[Fraction, Fraction]]:
        """Proved range of every argument and value, by name; the offset of a value is in it."""
        known = {
            a.signal.name: (a.low * a.format.unit, a.high * a.format.unit)
            for a in (*self.interface.inputs, *self.interface.outputs)
        }
        for value in self.body:
            unit = Fraction(2) ** -value.fraction
            known[value.name] = (value.offset + value.low * unit, value.offset + value.high * unit)
        return known

    @property
    def error_bounds(self) -> dict[str, Fraction]:
        """Error bound of every output after one call: that of its worst element, in units of the value."""
        return {argument.signal.name: max(argument.errors) for argument in self.interface.outputs}

    def as_data(self) -> dict[str, Any]:
        """Return formats, ranges and error bounds as plain JSON data."""
        adds_up = self.interface.accumulation
        elements = (
            zip(argument.signal.elements, argument.errors, strict=True) for argument in self.interface.outputs
        )
        return {
            "settings": self.interface.settings.as_dict(),
            "formats": {name: str(format_) for name, format_ in self.formats.items()},
            "ranges": {name: [float(low), float(high)] for name, (low, high) in self.ranges.items()},
            "error_bound": {name: float(bound) for name, bound in self.error_bounds.items()},
            "error_bound_by_element": {name: float(error) for pairs in elements for name, error in pairs},
            "integer_operations": self.operations,
            "accumulation": adds_up and {name: float(value) for name, value in asdict(adds_up).items()},
        }
