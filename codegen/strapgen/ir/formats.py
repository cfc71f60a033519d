"""`Format` is a fixed-point format: a word, its fraction bits, and the notation Qm.n."""

from __future__ import annotations

import re
from dataclasses import dataclass
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
    """Return the most fraction bits with which a word holds a magnitude."""
    top = (1 << (word - 1)) - 1
    if not largest:
        return word - 1
    bits = largest.numerator.bit_length() - largest.denominator.bit_length()
    fraction = word - bits + 1
    while _exceeds(largest, fraction, top):
        fraction -= 1
    return fraction


def _exceeds(largest: Fraction, fraction: int, top: int) -> bool:
    """Tell whether a magnitude with so many fraction bits exceeds an integer."""
    if fraction >= 0:
        return largest.numerator << fraction > top * largest.denominator
    return largest.numerator > top * largest.denominator << -fraction


def check_word(word: int) -> int:
    """Return a length of word in bits if the integer model has it."""
    if isinstance(word, bool) or not isinstance(word, int) or not SHORTEST_WORD <= word <= LONGEST_WORD:
        raise InputError(
            f"word is {word!r}; a whole number of bits from {SHORTEST_WORD} to {LONGEST_WORD} is needed"
        )
    return word


def check_rounding(rounding: str) -> str:
    """Return the name of a rounding if it is known."""
    return checks.choice("rounding", rounding, ROUNDINGS)
