"""The integer types of C on two kinds of processors, and the result types of operators."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class IntegerType:
    """An integer type; the standard's rank grows with the bits here."""

    bits: int
    signed: bool = True

    @property
    def low(self) -> int:
        """Its least number."""
        return -(1 << (self.bits - 1)) if self.signed else 0

    @property
    def high(self) -> int:
        """Its largest number."""
        return (1 << (self.bits - 1)) - 1 if self.signed else (1 << self.bits) - 1


@dataclass(frozen=True)
class Model:
    """Implementation-defined properties of C on a processor."""

    int_bits: int
    long_bits: int
    #: What Frama-C calls the model
    frama_c: str

    @property
    def plain(self) -> IntegerType:
        """The type int."""
        return IntegerType(self.int_bits)

    def named(self, names: tuple[str, ...]) -> IntegerType:
        """Return the type of a declaration, as ("unsigned", "int") or ("int32_t",).

        The types of 128 bits have names that end in "wide_" and "magnitude_".
        """
        word = names[-1]
        if word.endswith("_t"):
            return IntegerType(
                int(word.removeprefix("u").removeprefix("int").removesuffix("_t")), word[0] != "u"
            )
        if word.endswith(("_wide_", "_magnitude_")):
            return IntegerType(128, word.endswith("_wide_"))
        bits = {0: self.int_bits, 1: self.long_bits, 2: 64}[names.count("long")]
        return IntegerType(bits, "unsigned" not in names)

    def literal(self, text: str) -> tuple[int, IntegerType]:
        """Return the value and the type of an integer constant."""
        digits = text.rstrip("uUlL")
        value = int(digits, 0)
        signed = "u" not in text[len(digits) :].lower()
        for bits in (self.int_bits, self.long_bits, 64):
            kind = IntegerType(bits, signed)
            if value <= kind.high:
                return value, kind
            if digits[:2].lower() == "0x" and value <= IntegerType(bits, False).high:
                return value, IntegerType(bits, False)
        raise ValueError(f"{text} has no type")

    def promoted(self, kind: IntegerType) -> IntegerType:
        """Return the type of an operand after integer promotion."""
        return self.plain if kind.low >= self.plain.low and kind.high <= self.plain.high else kind

    def common(self, left: IntegerType, right: IntegerType) -> IntegerType:
        """Return the type of a sum, product or comparison."""
        left, right = self.promoted(left), self.promoted(right)
        longer = max(left.bits, right.bits)
        if left.signed == right.signed:
            return IntegerType(longer, left.signed)
        unsigned, signed = (left, right) if right.signed else (right, left)
        return unsigned if unsigned.bits >= signed.bits else signed


#: The models by what a claim calls them.
MODELS = {"64-bit processor": Model(32, 64, "gcc_x86_64"), "16-bit int": Model(16, 32, "gcc_x86_16")}
