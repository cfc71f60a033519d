"""The floating-point formats of generated C, and their largest errors of rounding to the nearest."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from strapgen.fixedpoint.terms import binary


@dataclass(frozen=True)
class NumberFormat:
    """A binary floating-point format of IEEE 754.

    >>> NUMBERS["float"].rounded(Fraction(1, 3)) * 2**25
    Fraction(11184811, 1)
    """

    precision: int  # bits of the significand, the leading one included
    smallest: int  # exponent of the smallest positive number: 2**smallest
    overflow: int  # exponent of the power of two that all numbers are below

    @property
    def unit(self) -> Fraction:
        """Half the distance from 1 to the next number: the largest relative error of a rounding."""
        return Fraction(1, 1 << self.precision)

    @property
    def underflow(self) -> Fraction:
        """Half the smallest number: the largest error of a rounding near zero."""
        return power_of_two(self.smallest - 1)

    def rounded(self, value: Fraction) -> Fraction:
        """Return the nearest number, of two the even one, as a literal is read."""
        if not value:
            return value
        place = max(exponent(abs(value)) - self.precision + 1, self.smallest)
        steps = round(binary(value.numerator, place) / value.denominator)
        return binary(steps, -place)

    def half_ulp(self, largest: Fraction) -> Fraction:
        """Return the largest error of rounding a number of at most this magnitude.

        Just above a power of two no number is farther from the nearest one than from that power.

        >>> NUMBERS["double"].half_ulp(Fraction(1)) * 2**54
        Fraction(1, 1)
        """
        if not largest:
            return Fraction(0)
        power = exponent(largest)
        above = largest - power_of_two(power)
        half = power_of_two(power - self.precision)
        return max(half / 2, min(half, above), self.underflow)

    def ulp(self, largest: Fraction) -> Fraction:
        """Return a unit in the last place of numbers of at most this magnitude: of a power of two, that below it."""
        if not largest:
            return Fraction(2) ** self.smallest
        power = exponent(largest)
        unit = Fraction(2) ** max(power - self.precision + 1, self.smallest)
        return unit if largest > Fraction(2) ** power else max(unit / 2, 2 * self.underflow)


#: The formats by the name of their type in C.
NUMBERS = {"double": NumberFormat(53, -1074, 1024), "float": NumberFormat(24, -149, 128)}


def exponent(value: Fraction) -> int:
    """Return the exponent of the largest power of two that is not above a positive number.

    >>> exponent(Fraction(5, 16)), exponent(Fraction(8))
    (-2, 3)
    """
    top, bottom = value.numerator, value.denominator
    power = top.bit_length() - bottom.bit_length()
    return power if top << max(0, -power) >= bottom << max(0, power) else power - 1


@lru_cache(maxsize=4096)
def power_of_two(power: int) -> Fraction:
    """Return a power of two."""
    return binary(1, -power)
