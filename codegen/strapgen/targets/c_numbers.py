"""The numbers of a generated C function as text: their types and literals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.targets.c import CPrinter, real_of


@dataclass(frozen=True)
class NumberText:
    """The numbers of a function in C: their type, that of error feedback, and the bits of a word, 0 for floats."""

    type: str
    feedback_type: str
    word: int
    printer: CPrinter | None

    def literal(self, value: Any) -> str:
        """Return a number as a C literal."""
        if self.printer is not None:
            return self.printer.constant(Fraction(float(value)))
        lowest = -(1 << (self.word - 1))
        return f"({lowest + 1} - 1)" if value == lowest else str(value)

    def text(self, value: Any) -> str:
        """Return a number in decimal digits that read as the very number, for CSV."""
        return (
            str(value) if self.printer is None else self.literal(value).removesuffix(self.printer.real.suffix)
        )


def numbers_of(sources: Sources) -> NumberText:
    """Return the types and the literals of a function's numbers."""
    if sources.fixed is None:
        real = real_of(sources.target)
        return NumberText(real.name, "", 0, CPrinter(real))
    word = WORDS[sources.fixed.settings.word]
    return NumberText(word.type, word.residual, word.bits, None)


def types_of(sources: Sources) -> dict[str, str]:
    """Return the C type of an element of every input and output by name; arguments may have words of other lengths."""
    signals = (*sources.function.inputs, *sources.function.outputs)
    types = {signal.name: numbers_of(sources).type for signal in signals}
    if sources.fixed is not None:
        arguments = (*sources.fixed.inputs, *sources.fixed.outputs)
        types |= {argument.signal.name: memory_type(argument) for argument in arguments}
    return types


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
