"""The words in which a navigator of 1984 puts its outputs on the bus: range and accuracy of each, as exact numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: Bits of a word, with its sign.
_FEWEST, _MOST = 2, 32
#: Part of the accuracy that rounding to a word may have at most, where none is stated.
_PART = Fraction(1, 10)


@dataclass(frozen=True)
class OutputWord:
    """An output as a binary fraction of its range, in two's complement, the first bit the sign."""

    #: Full scale in `unit`: what the first bit after the sign is half of
    range: Fraction
    unit: str
    #: Two standard deviations, as printed; None where there is none
    accuracy: Fraction | None = None
    #: Whether the output is an angle that goes on beyond its range from the other end
    turns: bool = False

    def quantum(self, bits: int) -> Fraction:
        """Return the value of the last place of a word of so many bits, in `unit`."""
        checks.count("bits", bits, smallest=_FEWEST, largest=_MOST)
        return Fraction(self.range, 1 << (bits - 1))

    def bits(self, part: Fraction = _PART) -> int:
        """Return the fewest bits whose rounding, half a quantum, is at most a part of the accuracy.

        >>> OUTPUT_WORDS["true_heading"].bits()
        13
        """
        if self.accuracy is None:
            raise InputError("the output has no printed accuracy; state the bits")
        for bits in range(_FEWEST, _MOST + 1):
            if self.quantum(bits) <= 2 * part * self.accuracy:
                return bits
        raise InputError(f"part is {part}; that takes more than {_MOST} bits")

    def encoded(self, value: Fraction | float, bits: int) -> int:
        """Return the nearest word to a value in `unit`; an angle turns, and anything else stops at the ends.

        >>> heading = OUTPUT_WORDS["true_heading"]
        >>> heading.encoded(190, 13), heading.encoded(-170, 13), OUTPUT_WORDS["body_rate"].encoded(200, 11)
        (-3868, -3868, 1023)
        """
        place = math.floor(Fraction(value) / self.quantum(bits) + Fraction(1, 2))
        half = 1 << (bits - 1)
        if self.turns:
            return (place + half) % (2 * half) - half
        return max(-half, min(half - 1, place))

    def decoded(self, word: int, bits: int) -> Fraction:
        """Return the value of a word in `unit`."""
        return word * self.quantum(bits)


_DEG = Fraction(180)
#: The outputs of Table 13 of Fenner's paper, by name; ranges are those of words on ARINC 429.
OUTPUT_WORDS: dict[str, OutputWord] = {
    "roll": OutputWord(_DEG, "deg", Fraction(1, 10), True),
    "pitch": OutputWord(_DEG, "deg", Fraction(1, 10), True),
    "true_heading": OutputWord(_DEG, "deg", Fraction(2, 5), True),
    "magnetic_heading": OutputWord(_DEG, "deg", Fraction(2), True),
    "body_acceleration": OutputWord(Fraction(4), "g", Fraction(1, 100)),
    "body_rate": OutputWord(Fraction(128), "deg/s", Fraction(1, 10)),
    "ground_velocity": OutputWord(Fraction(4096), "kn", Fraction(12)),
    "vertical_velocity": OutputWord(Fraction(32768), "ft/min", Fraction(30)),
    "track_angle": OutputWord(_DEG, "deg", Fraction(5), True),
    "drift_angle": OutputWord(Fraction(90), "deg", Fraction(5)),
    "flight_path_angle": OutputWord(_DEG, "deg", Fraction(2, 5), True),
    "track_acceleration": OutputWord(Fraction(1, 2), "g", Fraction(1, 100)),
    "vertical_acceleration": OutputWord(Fraction(4), "g", Fraction(1, 100)),
    "track_angle_rate": OutputWord(Fraction(32), "deg/s", Fraction(1, 4)),
    "inertial_altitude": OutputWord(Fraction(131072), "ft"),
}
