"""What is proved of the rounding of floating-point code: error bounds of a call and of a run, and their conditions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from typing import Any

from strapgen.ir.fixed_interface import RoundingAccumulation


@dataclass(frozen=True)
class Condition:
    """A value that must lie in a range for a bound to hold.

    Parameters
    ----------
    value : str
        What it is: the name of an input, for each of its elements, or a value on the way.
    low, high : Fraction
        Its range.
    """

    value: str
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
class RoundingBounds:
    """Bounds of how far the generated code is from exact arithmetic on the same inputs.

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
    accumulation : RoundingAccumulation or None
        How the errors of an attitude step add up over a run; None for other kernels.
    reason : str
        Why no bound is known; "" where there is one.
    """

    number: str
    precision: int
    inputs: tuple[Condition, ...] = ()
    conditions: tuple[Condition, ...] = ()
    functions: tuple[str, ...] = ()
    errors: Mapping[str, tuple[Fraction, ...]] = field(default_factory=dict, hash=False)
    accumulation: RoundingAccumulation | None = None
    reason: str = ""

    @property
    def unit(self) -> Fraction:
        """The distance from 1 to the next number."""
        return Fraction(2, 1 << self.precision)

    @property
    def worst(self) -> dict[str, Fraction]:
        """The largest error bound of an element by the name of the output."""
        return {name: max(errors) for name, errors in self.errors.items()}

    def as_data(self) -> dict[str, Any]:
        """Return the bounds for a reader of JSON, as floats rounded up; None where no bound is known."""
        adds_up = self.accumulation
        return {
            "inputs": {condition.value: float(condition.high) for condition in self.inputs},
            "conditions": {c.value: [float(c.low), float(c.high)] for c in self.conditions},
            "functions": list(self.functions),
            "errors": {name: [_up(error) for error in errors] for name, errors in self.errors.items()}
            or None,
            "run": adds_up and {"per_step": _up(adds_up.per_step), "growth": _up(adds_up.growth - 1)},
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
            adds_up and RoundingAccumulation(**{name: Fraction(value) for name, value in adds_up.items()}),
            data["reason"],
        )


def _up(value: Fraction) -> float:
    """Return a float that is not below a number."""
    near = float(value)
    return near if Fraction(near) >= value else math.nextafter(near, math.inf)
