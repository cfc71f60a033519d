"""Writes bounds with few digits on the safe side: upper bounds are rounded up, lower ones down."""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction


def above(value: Fraction, digits: int = 6, style: str = "g") -> str:
    """Return a decimal number that is not below a value; the style "e" has a power of ten in any case.

    >>> above(Fraction(2, 3)), above(Fraction(-2, 3), 2), above(Fraction(1, 3000), 3, "e")
    ('0.666667', '-0.66', '3.34e-04')
    """
    return _rounded(value, digits, style, ROUND_CEILING)


def below(value: Fraction, digits: int = 6, style: str = "g") -> str:
    """Return a decimal number that is not above a value, see `above`."""
    return _rounded(value, digits, style, ROUND_FLOOR)


def _rounded(value: Fraction, digits: int, style: str, rounding: str) -> str:
    quotient = Context(digits, rounding).divide(Decimal(value.numerator), Decimal(value.denominator))
    return f"{float(quotient):.{digits - (style == 'e')}{style}}"


def places_above(value: Fraction, places: int = 4) -> str:
    """Return a number with so many decimal places that is not below a value."""
    return f"{Decimal(math.ceil(value * 10**places)).scaleb(-places):.{places}f}"


def float_above(value: Fraction) -> float:
    """Return a float that is not below a value."""
    near = float(value)
    return near if Fraction(near) >= value else math.nextafter(near, math.inf)


def float_below(value: Fraction) -> float:
    """Return a float that is not above a value."""
    return -float_above(-value)
