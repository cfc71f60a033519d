"""Proved rounding of floating-point code: error bounds of a call and of a run, and their conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from typing import Any

from strapgen.ir.decimals import above, float_above, float_below
from strapgen.ir.fixed_interface import RoundingAccumulation
from strapgen.ir.notebook_display import short_repr


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
class RoundingBounds:
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
            "errors": {name: [float_above(error) for error in errors] for name, errors in self.errors.items()}
            or None,
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
            "errors": {name: list(map(str, errors)) for name, errors in self.errors.items()},
            "step": self.step and self.step.as_dict(),
            "accumulation": adds_up and {name: str(value) for name, value in asdict(adds_up).items()},
            "reason": self.reason,
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
            {name: tuple(map(Fraction, errors)) for name, errors in data["errors"].items()},
            data["step"] and StepRounding.from_dict(data["step"]),
            adds_up and RoundingAccumulation(**{name: Fraction(value) for name, value in adds_up.items()}),
            data["reason"],
        )
