"""Forms of numbers: fixed-point formats Qm.n, signed digits of constants, decimals on the safe side of a bound."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: The roundings of a value to its format, with the largest error in units of the last place.
ROUNDINGS = {"nearest": Fraction(1, 2), "truncation": Fraction(1)}

SHORTEST_WORD, LONGEST_WORD = 8, 64


@dataclass(frozen=True)
class Format:
    """A signed binary fixed-point format.

    Parameters
    ----------
    word : int
        Length of the word in bits, the sign among them.
    fraction : int
        Fraction bits: the integer n stands for n 2**-fraction. It may exceed the word or be negative.

    Examples
    --------
    >>> str(Format(32, 30)), Format(32, 30).unit, Format.parse("Q-5.36", 32).fraction
    ('Q1.30', Fraction(1, 1073741824), 36)
    """

    word: int
    fraction: int

    @classmethod
    def parse(cls, text: str, word: int) -> Format:
        """Read Qm.n: m integer bits without the sign and n fraction bits, m + n + 1 = word.

        Raises
        ------
        InputError
            If the text is no format of the word.
        """
        match = re.fullmatch(r"Q(-?[0-9]{1,4})\.(-?[0-9]{1,4})", text)
        if match is None:
            raise InputError(f"format {text!r} is not known; Qm.n is needed, as in Q1.{word - 2}")
        whole, fraction = map(int, match.groups())
        if whole + fraction + 1 != word:
            raise InputError(
                f"format {text} has {whole + fraction + 1} bits with its sign; {word} are needed, as in "
                f"Q{whole}.{word - 1 - whole}"
            )
        return cls(word, fraction)

    @property
    def unit(self) -> Fraction:
        """The unit of the last place."""
        return Fraction(2) ** -self.fraction

    @property
    def largest(self) -> int:
        """The largest integer that a word holds."""
        return (1 << (self.word - 1)) - 1

    def nearest(self, value: Fraction) -> int:
        """Return the integer of a number; the largest there is where the number lies just beyond.

        Examples
        --------
        >>> Format(16, 14).nearest(Fraction(1)), Format(16, 15).nearest(Fraction(1))
        (16384, 32767)
        """
        return min(round(value / self.unit), self.largest)

    def __str__(self) -> str:
        return f"Q{self.word - 1 - self.fraction}.{self.fraction}"


def finest(largest: Fraction, word: int) -> int:
    """Return the largest number of fraction bits with which a word holds a magnitude."""
    top = (1 << (word - 1)) - 1
    if not largest:
        return word - 1
    bits = largest.numerator.bit_length() - largest.denominator.bit_length()
    fraction = word - bits + 1
    while _exceeds(largest, fraction, top):
        fraction -= 1
    return fraction


def _exceeds(largest: Fraction, fraction: int, top: int) -> bool:
    """Return whether a magnitude with so many fraction bits exceeds an integer."""
    if fraction >= 0:
        return largest.numerator << fraction > top * largest.denominator
    return largest.numerator > top * largest.denominator << -fraction


def check_word(word: int) -> int:
    """Return a length of word in bits if the integer model has it."""
    if not checks.is_whole(word) or not SHORTEST_WORD <= word <= LONGEST_WORD:
        raise InputError(
            f"word is {word!r}; a whole number of bits from {SHORTEST_WORD} to {LONGEST_WORD} is needed"
        )
    return int(word)


def check_rounding(rounding: str) -> str:
    """Return the name of a rounding if it is known."""
    return checks.choice("rounding", rounding, ROUNDINGS)


#: How products are computed, and what that is in words.
MULTIPLICATIONS = {
    "product": "by the processor's multiplication",
    "shift-add": "as sums of shifted terms, by the canonical signed digits of the constant",
    "high": "by the high words of all products alone, which are added up in words",
    "half": "likewise, each high word from three products of half words, without that of the lower halves",
}
#: Words with which products are narrowed alone, by the way of that.
WORDS_OF_HIGH_PRODUCTS = {"high": (32, 64), "half": (32,)}
#: By how many units a high word is below the product at most: rounded down, and without the lower halves.
LOST = {"high": 1, "half": 3}


def signed_digits(value: int, most: int = 0) -> tuple[tuple[int, int], ...]:
    """Return the canonical signed digits of an integer, of which no two are neighbours: the `most` largest, 0 for all.

    Each has a sign and a power of two.

    >>> signed_digits(7), signed_digits(-11), signed_digits(1365, 2)
    (((1, 3), (-1, 0)), ((-1, 4), (1, 2), (1, 0)), ((1, 10), (1, 8)))
    """
    digits: list[tuple[int, int]] = []
    rest, power = abs(value), 0
    while rest:
        if rest & 1:
            digit = 2 - (rest & 3)
            digits.append((digit if value > 0 else -digit, power))
            rest -= digit
        rest >>= 1
        power += 1
    digits.reverse()
    return tuple(digits[:most] if most else digits)


def from_digits(digits: tuple[tuple[int, int], ...]) -> int:
    """Return the integer that digits stand for."""
    return sum(sign << power for sign, power in digits)


def above(value: Fraction, digits: int = 6, style: str = "g") -> str:
    """Return a decimal number that is not below a value; the style "e" has a power of ten in any case.

    >>> above(Fraction(2, 3)), above(Fraction(-2, 3), 2), above(Fraction(1, 3000), 3, "e")
    ('0.666667', '-0.66', '3.34e-04')
    """
    return _round(value, digits, style, ROUND_CEILING)


def below(value: Fraction, digits: int = 6, style: str = "g") -> str:
    """Return a decimal number that is not above a value, see `above`."""
    return _round(value, digits, style, ROUND_FLOOR)


def _round(value: Fraction, digits: int, style: str, rounding: str) -> str:
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
