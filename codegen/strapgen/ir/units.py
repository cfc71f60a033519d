"""Units in which users write quantities, as logs and data sheets spell them, and the scale of a gyro that counts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: A g in m/s^2: standard gravity, by definition.
STANDARD_GRAVITY = 9.80665
#: pi to 50 decimals: what it leaves out of a scale is below 1e-50 of it.
PI = Fraction(314159265358979323846264338327950288419716939937510, 10**50)

#: Units of a rate by their name for readers, in rad/s.
RATES = {
    "rad/s": Fraction(1),
    "deg/s": PI / 180,
    "mdeg/s": PI / 180_000,
    "mrad/s": Fraction(1, 1000),
    "deg/h": PI / 180 / 3600,
}
#: Units of time in s.
TIMES = {
    "s": Fraction(1),
    "ms": Fraction(1, 10**3),
    "us": Fraction(1, 10**6),
    "ns": Fraction(1, 10**9),
}
#: Units of specific force in m/s^2.
FORCES = {
    "m/s^2": Fraction(1),
    "g": Fraction("9.80665"),
    "mg": Fraction("0.00980665"),
}

#: Other spellings, once `_plain` has simplified them.
_SPELLINGS = {
    "dps": "deg/s",
    "mdps": "mdeg/s",
    "degree/s": "deg/s",
    "rads": "rad/s",
    "degs": "deg/s",
    "radian/s": "rad/s",
    "sec": "s",
    "second": "s",
    "millisecond": "ms",
    "msec": "ms",
    "microsecond": "us",
    "usec": "us",
    "nanosecond": "ns",
    "nsec": "ns",
    "m/s/s": "m/s^2",
    "m/s2": "m/s^2",
    "deg/hr": "deg/h",
}


def split(text: str) -> tuple[str, str]:
    """Return the number and the unit of a quantity, as texts.

    >>> split("17.5mdps"), split("3e-4 rad/s"), split("1/1000rad")
    (('17.5', 'mdps'), ('3e-4', 'rad/s'), ('1/1000', 'rad'))
    """
    number, unit = re.fullmatch(r"([-+\d./ ]*(?:[eE][-+]?\d+)?)(.*)", text.strip(), flags=re.DOTALL).groups()  # type: ignore[union-attr]
    return number.strip(), unit.strip()


def spelled(text: str) -> str:
    """Return a unit in one spelling; an unknown one as it is.

    >>> [spelled(text) for text in ("rad s^-1", "°/s", "dps", "deg/sec", "µs", "m/s²", "uT")]
    ['rad/s', 'deg/s', 'deg/s', 'deg/s', 'us', 'm/s^2', 'uT']
    """
    plain = _plain(text)
    found = _SPELLINGS.get(plain, plain)
    return found if found in {*RATES, *TIMES, *FORCES, _ANGLE, "deg"} else text.strip()


def _plain(text: str) -> str:
    text = text.strip().lower().replace("µ", "u").replace("μ", "u").replace("°", "deg")
    text = text.replace("²", "^2").replace("⁻¹", "^-1").replace("⁻²", "^-2").replace("**", "^")
    text = (
        re.sub(r"[\s*·]*s\^-?2$|[\s*·]+s\^-2$", "/s^2", text)
        if text.startswith("m") and "/" not in text
        else text
    )
    text = re.sub(r"[\s*·_]*(?:s|sec)\^-1$", "/s", text)
    text = re.sub(r"\s+", "", text)
    text = re.sub(r"/(?:sec|second)s?$", "/s", text)
    if text.startswith(("degrees", "radians")):
        text = text.replace("degrees", "deg", 1).replace("radians", "rad", 1)
    return (
        text.removesuffix("s")
        if text.endswith("onds") or text in ("secs", "msecs", "usecs", "nsecs")
        else text
    )


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
        digits, unit = split(text)
        name = spelled(unit)
        if name != _ANGLE and name not in RATES:
            raise InputError(
                f"lsb is {text!r}; a number with its unit is needed: mdps, dps, deg/s or rad/s for a rate a count, "
                "as 0.0175dps, or rad for an angle"
            )
        value = checks.number("lsb", digits, positive=True)
        if name == _ANGLE:
            return cls(value, f"{digits} rad", f"--lsb-rad {digits}")
        if interval is None:
            raise InputError(f"lsb {text} is a rate; --sample-hz is missing, which makes it an angle")
        angle = value * RATES[name] * interval
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
