"""The C types for words of each length."""

from __future__ import annotations

from dataclasses import dataclass, replace

from strapgen.ir.fixed_interface import Argument


@dataclass(frozen=True)
class Word:
    """The C types for words of one length.

    Parameters
    ----------
    bits : int
    type, residual : str
        Types of a word in memory, and of an error feedback, which has no sign.
    fast : str
        Type of a word in a calculation: the fastest of the processor that is long enough.
    wide, magnitude : str
        Types of a product, and of the magnitude of a product. C has none for words of 64 bits: a file defines them
        under names of its own.
    """

    bits: int
    type: str
    residual: str
    fast: str
    wide: str
    magnitude: str

    def within(self, name: str) -> Word:
        """Return the types as the file of a function calls them."""
        return replace(self, wide=self.wide.format(name), magnitude=self.magnitude.format(name))


WORDS = {
    16: Word(16, "int16_t", "uint16_t", "int", "int32_t", "uint32_t"),
    32: Word(32, "int32_t", "uint32_t", "int32_t", "int64_t", "uint64_t"),
    64: Word(64, "int64_t", "uint64_t", "int64_t", "{}_wide_", "{}_magnitude_"),
}


def memory_type(argument: Argument) -> str:
    """Return the type of an argument's elements in memory: that of a word, or a shorter one of a gyro's counts."""
    return f"int{argument.format.word}_t"
