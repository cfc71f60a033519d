"""`Sensor` is the scale of a gyro that counts: the angle of one count, which need not be a power of two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from strapgen.ir import checks, units
from strapgen.ir.exceptions import InputError

#: The unit of an angle a count.
_ANGLE = "rad"
#: Bits of a count where none are stated: those of nearly all gyros.
DEFAULT_BITS = 16


@dataclass(frozen=True)
class Sensor:
    """The scale of a gyro that counts.

    A count c stands for the angle ``c * count``. Code computes with ``u = c * 2**-fraction``, so that
    ``c * count = scale * u``; the scale is above 1/2 and at most 1.

    >>> Sensor.of("0.0175dps", Fraction(1, 100)).fraction
    18
    >>> Sensor.of("1/1000rad").scale
    Fraction(64, 125)
    """

    count: Fraction  # angle of one count in rad
    unit: str  # that angle in the user's words
    stated: str  # the options of the command line that it follows from

    @classmethod
    def of(cls, lsb: Any, interval: Fraction | None = None, heard: str = "") -> Sensor:
        """Return the scale of an lsb: "0.0175dps" or "3e-4rad/s" with the time of a count in s, or "3e-6rad"."""
        text = str(lsb).strip()
        digits, unit = units.split(text)
        name = units.spelled(unit)
        if name != _ANGLE and name not in units.RATES:
            raise InputError(
                f"lsb is {text!r}; a number with its unit is needed: mdps, dps, deg/s or rad/s for a rate a count, "
                "as 0.0175dps, or rad for an angle"
            )
        value = checks.number("lsb", digits, positive=True)
        if name == _ANGLE:
            return cls(value, f"{digits} rad", f"--lsb-rad {digits}")
        if interval is None:
            raise InputError(f"lsb {text} is a rate; --sample-hz is missing, which makes it an angle")
        angle = value * units.RATES[name] * interval
        stated = f"{heard} --lsb {digits}{name if ' ' in unit else unit}".strip()
        return cls(angle, f"{digits} {name} * {_decimal(interval)} s", stated)

    @property
    def fraction(self) -> int:
        """Fraction bits of the number that a count is in the code."""
        bits = self.count.denominator.bit_length() - self.count.numerator.bit_length()
        return bits - 1 if self.count * Fraction(2) ** bits > 1 else bits

    @property
    def scale(self) -> Fraction:
        """The factor of that number in exact arithmetic, above 1/2 and at most 1."""
        return self.count * Fraction(2) ** self.fraction

    @property
    def is_rounded(self) -> bool:
        """Whether pi is in the scale, which is then off by less than 1e-50 of itself."""
        return "deg" in self.unit

    def as_dict(self) -> dict[str, str]:
        """Return the scale as plain JSON data."""
        return {"count": str(self.count), "unit": self.unit, "stated": self.stated}

    @classmethod
    def from_dict(cls, data: Mapping[str, str]) -> Sensor:
        """Rebuild a scale from `as_dict`."""
        return cls(Fraction(data["count"]), data["unit"], data["stated"])


def _decimal(value: Fraction) -> str:
    """Return a time as a decimal if it has one of few digits, else as a fraction."""
    text = f"{float(value):.12g}"
    return text if Fraction(text) == value else str(value)
