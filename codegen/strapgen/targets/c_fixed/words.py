"""The C types for words of each length."""

from __future__ import annotations

from dataclasses import dataclass, replace

from strapgen.ir.interfaces import Argument


@dataclass(frozen=True)
class Word:
    """The C types for words of one length."""

    bits: int
    type: str  # of a word in memory
    residual: str  # of an error feedback, which has no sign
    fast: str  # of a word in a calculation: the fastest of the processor that is long enough
    #: Of a product, and of its magnitude. C has none for words of 64 bits: a file defines them under names of its own.
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
