"""The interface of generated code: formats, ranges, and proved error bounds of a call and of a run.

`Interface` is that of fixed-point code, `RoundingBounds` that of floating-point code.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from typing import Any

from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format, above, float_above, float_below
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor


@dataclass(frozen=True)
class ErrorFeedback:
    """The bits below the last place of a value, which are fed back into the next call: a word without a sign.

    The sum starts from it in place of a constant for rounding, and the low bits of the sum are the next error feedback.
    A run starts from half a unit of the last place for rounding to the nearest, and from zero for truncation; every
    other word is allowed too.
    """

    name: str
    fraction: int  # bits
    shift: int  # to the fraction of the sum, at most 0: `word * 2**shift` is added, which drops bits
    fresh: int  # the word that a run starts from


@dataclass(frozen=True)
class Argument:
    """An input or an output of a fixed-point function."""

    signal: Signal
    format: Format
    values: tuple[str, ...]  # the value that holds each element
    #: The range of the integers: an input outside is refused, an output is proved to lie inside.
    low: int
    high: int
    errors: tuple[Fraction, ...]  # bound for each element of an output after one call; zeros for an input
    sensor: Sensor | None = None  # the scale of the gyro whose counts these are

    @property
    def unit(self) -> Fraction:
        """The value of the integer 1, in the unit of the signal."""
        return self.format.unit if self.sensor is None else self.sensor.count

    @property
    def saturates(self) -> bool:
        """Whether it is an attitude in -1 to 1 less a unit: a number beyond is stored as the nearer end."""
        return bool(self.signal.constraint) and self.format.fraction == self.format.word - 1


@dataclass(frozen=True)
class RoundingAccumulation:
    """The error of a run due to rounding, as the length of a state or of a row of a matrix."""

    once: Fraction
    per_step: Fraction
    input_rounding: Fraction  # for each step, if increments are rounded to their format first
    growth: Fraction  # largest factor by which a step stretches the error before it

    def bound(self, steps: int, rounded_inputs: bool = False, stretch: float | None = None) -> float:
        """Return a bound of the error after a number of steps; inf where no useful bound is known.

        With `rounded_inputs` increments are rounded to their format first; `stretch` is the largest factor by which all
        transitions together stretch a difference, where it is known better than by `growth`.

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

    def calls_within(self, allowance: Fraction) -> int:
        """Return the number of calls in which a state of length 1 is proved not to exceed 1 by more than an allowance.

        >>> a_step = RoundingAccumulation(Fraction(0), Fraction(1, 2**10), Fraction(0), Fraction(1))
        >>> a_step.calls_within(Fraction(1, 16))
        63
        """
        # An exact step stretches the state by at most `growth`, as it does the error before it.
        room, low, high = math.log1p(float(allowance)) * (1 - 1e-6), 0, 1 << 40
        while high - low > 1:
            steps = (low + high) // 2
            rounded = float(self.once) + steps * float(self.per_step)
            inside = math.log1p(rounded) + steps * float(self.growth - 1) <= room
            low, high = (steps, high) if inside else (low, steps)
        return low


@dataclass(frozen=True)
class Interface:
    """The facts that a caller of fixed-point code must know."""

    settings: Settings
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    residuals: tuple[ErrorFeedback, ...]
    accumulation: RoundingAccumulation | None  # of a step
    angle_accumulation: AngleAccumulation | None = None  # None where nothing is proved

    @property
    def normalized_within(self) -> int:
        """The proved number of steps between normalizations without a refused call or an improper state, or 0."""
        if self.accumulation is None or self.angle_accumulation is None:
            return 0
        return min(
            self.angle_accumulation.proved_steps, self.accumulation.calls_within(self.settings.allowance)
        )

    @property
    def companion_settings(self) -> Settings:
        """The settings of a kernel on the same state as a step, for instance an orthonormalization."""
        formats = {} if self.settings.state else {"state": str(self.inputs[0].format)}
        return replace(self.settings, ranges={}, formats=formats).without_counts()


#: Largest error of an element of an orthonormalization's result for which anything is proved.
LARGEST_ERROR = Fraction(1, 1 << 12)


@dataclass(frozen=True)
class AngleAccumulation:
    """The angle between the computed attitude and that of exact arithmetic on the same increments.

    It is at most ``once + per_step N + per_normalization M`` after N steps and M normalizations, while the state stays
    proper. A vector of parameters is proper while its length is at least `shortest`; a matrix while its singular values
    lie between `shortest` and the root of 2 - `shortest`**2. The attitude of a matrix is the nearest rotation.
    """

    once: Fraction  # rad
    per_step: Fraction  # rad
    input_rounding: Fraction  # rad a step, if increments are rounded to their format first
    #: In rad, of a normalization that multiplies the words of the state by one factor and rounds each of them once; an
    #: orthonormalization of a matrix has it too.
    per_normalization: Fraction
    #: In rad, of an orthonormalization that multiplies the matrix C by a symmetric expansion of the inverse root of
    #: C'C, per error of an element of its result; None where nothing is proved.
    per_element: Fraction | None
    shortest: Fraction  # length, or singular value, from which the bound holds
    #: Least length of the state from which `proved_steps` counts; of a matrix, least singular value, the largest
    #: being at most the root of 2 - `start`**2.
    start: Fraction
    proved_steps: int  # those in which the state is proved to stay proper
    beyond: Fraction  # factor of the bound over more steps, if the state stays proper all the same
    orthonormalized: Fraction  # factor of the steps' part of a run with orthonormalizations
    dual_rows_apart: int  # most steps between orthonormalizations by dual rows; 0 where nothing is proved
    dual_rows_growth: Fraction  # such an orthonormalization stretches the error by at most 1 and this
    added: Fraction = Fraction(0)  # rounding of a proper state in a step, as the length of all its elements

    @property
    def dual_rows_error(self) -> Fraction:
        """Largest error of an element of an orthonormalization by dual rows for which anything is proved."""
        return (1 - self.shortest) / 1024

    @property
    def dual_rows_start(self) -> Fraction:
        """Largest distance from 1 of a matrix's squared singular values where a run with dual rows begins."""
        return (1 - self.shortest) / 65

    def bound(
        self,
        steps: int,
        normalizations: int = 0,
        error: Fraction | float = 0,
        rounded_inputs: bool = False,
        dual_rows: bool = False,
    ) -> float:
        """Return a bound of the angle after a number of steps, in rad; inf where nothing is proved.

        Normalizations, or orthonormalizations, count among the steps and are at most `proved_steps` apart, or
        `dual_rows_apart` if it is that scheme; `error` bounds an element of an orthonormalization's result, up to
        `LARGEST_ERROR`. With `rounded_inputs` increments are rounded to their format first.

        >>> one, unit = Fraction(1), Fraction(1, 1000)
        >>> run = AngleAccumulation(4 * unit, unit, unit, 2 * unit, 0 * one, one / 2, one, 100, one, one, 0, 0 * one)
        >>> round(run.bound(10, normalizations=1), 6)
        0.016
        """
        total = self.once + steps * (self.per_step + (self.input_rounding if rounded_inputs else 0))
        if normalizations:
            limit = self.dual_rows_error if dual_rows else LARGEST_ERROR
            if self.per_element is None or (self.per_element and error > limit):
                return math.inf
            added = self.per_normalization + self.per_element * Fraction(error)
            total = total * self.orthonormalized + normalizations * added
            if dual_rows:
                return self._stretched(total, normalizations)
        elif steps > self.proved_steps:
            total *= self.beyond
        return math.nextafter(float(total), math.inf)

    def _stretched(self, total: Fraction, normalizations: int) -> float:
        """Return a bound after so many orthonormalizations by dual rows."""
        exponent = normalizations * float(self.dual_rows_growth)
        if not self.dual_rows_apart or exponent > 100:
            return math.inf
        return float(total) * math.exp(exponent) * (1 + 1e-12)  # which covers the rounding of this line


@dataclass(frozen=True)
class Condition:
    """A value that must lie in a range for a bound to hold."""

    value: str  # the name of an input, for each of its elements, or a value on the way in words
    low: Fraction
    high: Fraction

    def as_dict(self) -> dict[str, str]:
        """Return the condition as plain JSON data."""
        return {"value": self.value, "low": str(self.low), "high": str(self.high)}

    @classmethod
    def from_dict(cls, data: Mapping[str, str]) -> Condition:
        """Rebuild a condition from `as_dict`."""
        return cls(data["value"], Fraction(data["low"]), Fraction(data["high"]))


@dataclass(frozen=True)
class StepRounding:
    """The errors r and d that one call of an attitude step adds to a run, which computes x T + x d + r."""

    local: tuple[Fraction, ...]  # bounds of r, by element of the state
    transition: tuple[Fraction, ...]  # bounds of d, by element of the transition
    away: tuple[Fraction, ...]  # bounds of the distance of T from the identity

    def as_dict(self) -> dict[str, list[str]]:
        """Return the errors as plain JSON data."""
        return {name: list(map(str, errors)) for name, errors in asdict(self).items()}

    @classmethod
    def from_dict(cls, data: Mapping[str, list[str]]) -> StepRounding:
        """Rebuild the errors from `as_dict`."""
        return cls(**{name: tuple(map(Fraction, errors)) for name, errors in data.items()})


@dataclass(frozen=True)
class AnyOrder(ReadOnly):
    """Bounds in any order of the operations, contracted or not, with numbers near zero flushed to it or not.

    Parameters
    ----------
    errors : mapping of str to tuple of Fraction
        Error bound of each element by the name of the output, row-major; empty where no bound is known.
    per_step : Fraction or None
        The error that one call of an attitude step adds to a run; None for other kernels.
    roundings : int
        Number of roundings from an input to an output that they include.
    approximates : bool
        Whether quotients or roots are among them, within 2 units of the last place.
    without : str
        The operations that have no bound; "" where there is one.
    """

    errors: Mapping[str, tuple[Fraction, ...]] = field(default_factory=dict, hash=False)
    per_step: Fraction | None = None
    roundings: int = 0
    approximates: bool = False
    without: str = ""

    @property
    def worst(self) -> dict[str, Fraction]:
        """The largest error bound of an element by the name of the output."""
        return {name: max(errors) for name, errors in self.errors.items()}

    def as_dict(self) -> dict[str, Any]:
        """Return the bounds as plain JSON data, exactly."""
        return {
            "errors": _as_text(self.errors),
            "per_step": None if self.per_step is None else str(self.per_step),
            "roundings": self.roundings,
            "approximates": self.approximates,
            "without": self.without,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> AnyOrder:
        """Rebuild bounds from `as_dict`."""
        per_step = data["per_step"]
        return cls(
            _as_numbers(data["errors"]),
            per_step and Fraction(per_step),
            data["roundings"],
            data["approximates"],
            data["without"],
        )


def _as_text(errors: Mapping[str, tuple[Fraction, ...]]) -> dict[str, list[str]]:
    return {name: list(map(str, each)) for name, each in errors.items()}


def _as_floats(errors: Mapping[str, tuple[Fraction, ...]]) -> dict[str, list[float]] | None:
    return {name: list(map(float_above, each)) for name, each in errors.items()} or None


def _as_numbers(errors: Mapping[str, Iterable[str]]) -> dict[str, tuple[Fraction, ...]]:
    return {name: tuple(map(Fraction, each)) for name, each in errors.items()}


@dataclass(frozen=True)
class RoundingBounds(ReadOnly):
    """Bounds of the distance of generated code from exact arithmetic on the same inputs.

    They hold in arithmetic of IEEE 754 with rounding to the nearest and with subnormal numbers, where every operation
    is rounded to the type and no product and sum are contracted.

    Parameters
    ----------
    number : str
        Type of the numbers, "double" or "float".
    precision : int
        Bits of its significand.
    inputs : tuple of Condition
        The range of the elements of every input.
    conditions : tuple of Condition
        Ranges of values on the way, in exact arithmetic, which no proof keeps there.
    functions : tuple of str
        Functions of the C library that are assumed to err by at most a unit in the last place.
    errors : mapping of str to tuple of Fraction
        Error bound of each element by the name of the output, row-major; empty where no bound is known.
    step : StepRounding or None
        The errors that one call of an attitude step adds to a run; None for other kernels.
    accumulation : RoundingAccumulation or None
        Their accumulation over a run; None for other kernels.
    reason : str
        The reason why no bound is known; "" where there is one.
    any_order : AnyOrder or None
        The bounds of the code compiled with ``-ffast-math``; None where no bound is known.

    Examples
    --------
    >>> from strapgen import algorithm, rounding_bounds
    >>> bounds = rounding_bounds(algorithm("euler").program(), "float")
    >>> bounds.number, max(bounds.errors["next"]) < 5e-7
    ('float', True)
    """

    number: str
    precision: int
    inputs: tuple[Condition, ...] = ()
    conditions: tuple[Condition, ...] = ()
    functions: tuple[str, ...] = ()
    errors: Mapping[str, tuple[Fraction, ...]] = field(default_factory=dict, hash=False)
    step: StepRounding | None = None
    accumulation: RoundingAccumulation | None = None
    reason: str = ""
    any_order: AnyOrder | None = None

    __repr__ = short_repr

    def _in_words(self) -> str:
        if self.reason:
            return f"none known in {self.number}: {self.reason}"
        worst = ", ".join(f"{name} {above(error, 3, 'e')}" for name, error in self.worst.items())
        return f"of a call in {self.number}: {worst}"

    @property
    def unit(self) -> Fraction:
        """The distance from 1 to the next number."""
        return Fraction(2, 1 << self.precision)

    @property
    def worst(self) -> dict[str, Fraction]:
        """The largest error bound of an element by the name of the output."""
        return {name: max(errors) for name, errors in self.errors.items()}

    def as_data(self) -> dict[str, Any]:
        """Return the bounds for a reader of JSON, as floats on the safe side; None where no bound is known."""
        adds_up = self.accumulation
        return {
            "inputs": {condition.value: float_below(condition.high) for condition in self.inputs},
            "conditions": {c.value: [float_above(c.low), float_below(c.high)] for c in self.conditions},
            "functions": list(self.functions),
            "errors": _as_floats(self.errors),
            "errors_in_any_order": self.any_order and _as_floats(self.any_order.errors),
            "run": adds_up
            and {"per_step": float_above(adds_up.per_step), "growth": float_above(adds_up.growth - 1)},
            "reason": self.reason or None,
        }

    def as_dict(self) -> dict[str, Any]:
        """Return the bounds as plain JSON data, exactly."""
        adds_up = self.accumulation
        return {
            "number": self.number,
            "precision": self.precision,
            "inputs": [condition.as_dict() for condition in self.inputs],
            "conditions": [condition.as_dict() for condition in self.conditions],
            "functions": list(self.functions),
            "errors": _as_text(self.errors),
            "step": self.step and self.step.as_dict(),
            "accumulation": adds_up and {name: str(value) for name, value in asdict(adds_up).items()},
            "reason": self.reason,
            "any_order": self.any_order and self.any_order.as_dict(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RoundingBounds:
        """Rebuild bounds from `as_dict`."""
        adds_up = data["accumulation"]
        return cls(
            data["number"],
            data["precision"],
            tuple(map(Condition.from_dict, data["inputs"])),
            tuple(map(Condition.from_dict, data["conditions"])),
            tuple(data["functions"]),
            _as_numbers(data["errors"]),
            data["step"] and StepRounding.from_dict(data["step"]),
            adds_up and RoundingAccumulation(**{name: Fraction(value) for name, value in adds_up.items()}),
            data["reason"],
            data["any_order"] and AnyOrder.from_dict(data["any_order"]),
        )
