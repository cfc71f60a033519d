"""Units in which users write quantities, with the spellings that logs and data sheets have."""

from __future__ import annotations

import re
from fractions import Fraction

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
#: Units of specific force, which tell an accelerometer from a gyro.
FORCES = ("m/s^2", "g", "mg")

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
    """Return a unit in one spelling; an unknown one as it is, simplified.

    >>> [spelled(text) for text in ("rad s^-1", "°/s", "dps", "deg/sec", "µs", "m/s²")]
    ['rad/s', 'deg/s', 'deg/s', 'deg/s', 'us', 'm/s^2']
    """
    plain = _plain(text)
    return _SPELLINGS.get(plain, plain)


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
