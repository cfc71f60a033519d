"""Fixed-point programs: straight-line code on integers, with a proved range and error bound for every value.

A word holds `word` bits, a wide number twice as many. Sums of products are exact in wide numbers and are rounded once.
Nothing here knows C or Python text; targets print it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Any, TypeVar

from strapgen.ir.formats import Format, above, float_above, float_below
from strapgen.ir.interfaces import ErrorFeedback, Interface
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.notebook_display import notebook_html, short_repr
from strapgen.ir.program import Program
from strapgen.ir.read_only import ReadOnly

T = TypeVar("T")


@dataclass(frozen=True)
class Coefficient:
    """The exact number that an integer factor stands for: the factor is ``value * 2**fraction``, rounded."""

    value: Fraction
    fraction: int


@dataclass(frozen=True)
class Term:
    """``factor * product of values * 2**shift``, an integer; a shift below zero rounds down."""

    names: tuple[str, ...]  # up to two values; two are words
    factor: int  # not zero; 1 or -1 with two values
    shift: int = 0
    coefficient: Coefficient | None = None  # that of a factor that is a rounded number


@dataclass(frozen=True)
class IntegerSum:
    """A sum of fine terms that is divided by 2**shift and rounded, plus coarse terms that are exact after that."""

    fine: tuple[Term, ...]  # those that are rounded; all if nothing is rounded
    shift: int = 0  # bits that the rounding drops
    coarse: tuple[Term, ...] = ()  # those that are integers at the fraction of the result
    residual: ErrorFeedback | None = None  # the rounding error of the last call, in place of half a unit
    drop: int = 0  # bits below the last one of the error feedback, dropped before it is added
    #: Whether the rounded sum, and every partial sum with coarse terms, fits into a word.
    in_words: bool = False
    #: Whether it is rounded down, as the certified error allows, where words are rounded to the nearest.
    down: bool = False
    #: Whether it is one product, divided by 2**shift by `high_word_of_halves`; the shift is that of a word.
    halves: bool = False

    def half(self, rounding: str) -> int:
        """Return half a unit of the result, which is added before the shift; 0 where nothing is."""
        nearest = rounding == "nearest" and not (self.down or self.halves) and self.residual is None
        return 1 << (self.shift - 1) if self.shift and nearest else 0


def high_word_of_halves(a: int, b: int, word: int) -> int:
    """Return a b / 2**word, less by up to 3: without the product of the lower halves of two words.

    >>> high_word_of_halves(-1, 1 << 31, 32), high_word_of_halves(65537, 65537, 32)
    (-1, 1)
    """
    bits = word // 2
    (a_high, a_low), (b_high, b_low) = divmod(a, 1 << bits), divmod(b, 1 << bits)
    return a_high * b_high + (a_high * b_low >> bits) + (a_low * b_high >> bits)


@dataclass(frozen=True)
class Scaled:
    """A value or an integer constant, times 2**shift."""

    value: str | int
    shift: int = 0


@dataclass(frozen=True)
class IntegerOperation:
    """An operation on integers that is no sum.

    Its kinds are "divide", numerator and denominator, which has one sign; "sqrt", of one that is not negative;
    "maximum"; and "select", see `cases_of`. Quotients and roots are rounded. Integers that are compared have one
    fraction, and so have those that are selected.
    """

    kind: str
    arguments: tuple[Scaled, ...]


def cases_of(arguments: Sequence[T]) -> list[tuple[T, T, T]]:
    """Return the cases of a selection: left side, right side and value; the last argument holds otherwise.

    It selects the value of the first case whose left side is at least its right side.
    """
    return [(arguments[k], arguments[k + 1], arguments[k + 2]) for k in range(0, len(arguments) - 1, 3)]


@dataclass(frozen=True)
class Value:
    """An integer of a fixed-point program: it stands for ``offset + integer * 2**-fraction``."""

    name: str
    definition: IntegerSum | IntegerOperation | None  # None for an element of an input
    fraction: int
    wide: bool  # whether the integer may exceed a word, so that a wide number holds it
    #: The proved range of the integer.
    low: int
    high: int
    offset: Fraction  # the constant that is not stored
    error: Fraction  # bound of the distance from the exact value, in units of the value
    peak: int  # bound of the magnitude of every partial sum
    #: Whether the range is checked when the code runs: a call outside returns an error
    range_checked: bool = False
    meaning: str = ""  # the comment where a named stage of the algorithm begins
    #: Whether the nearer end of the range replaces integers outside; `error` is that before.
    saturated: bool = False

    @property
    def magnitude(self) -> int:
        """Largest magnitude of the integer."""
        return max(abs(self.low), abs(self.high))


def used_by(value: Value) -> list[str]:
    """Return the names that a value is computed from."""
    match value.definition:
        case IntegerSum(fine, coarse=coarse):
            return [name for term in (*fine, *coarse) for name in term.names]
        case IntegerOperation(_, arguments):
            return [operand.value for operand in arguments if isinstance(operand.value, str)]
    return []


def operation_counts(body: Iterable[Value], rounding: str) -> dict[str, int]:
    """Return the number of integer operations of each kind."""
    counts = dict.fromkeys(("add", "multiply", "shift", "divide", "sqrt", "compare"), 0)
    for value in body:
        match value.definition:
            case IntegerSum() as total:
                for kind, count in _sum_counts(total, rounding).items():
                    counts[kind] += count
            case IntegerOperation("maximum", arguments):
                counts["compare"] += len(arguments) - 1
            case IntegerOperation("select", arguments):
                counts["compare"] += len(cases_of(arguments))
            case IntegerOperation(kind):
                counts[kind] += 1
    return counts


def _sum_counts(total: IntegerSum, rounding: str) -> dict[str, int]:
    """Return the numbers of additions, multiplications and shifts of a sum."""
    terms = [*total.fine, *total.coarse]
    products = sum(len(t.names) == 2 or (abs(t.factor) != 1 and bool(t.names)) for t in terms)
    if total.halves:
        return {"add": 2, "multiply": 3, "shift": 2}
    additions = max(0, len(terms) - 1)
    shifts = sum(bool(term.shift) for term in terms) + bool(total.shift)
    if total.residual is not None:
        additions += 1
        shifts += 2 * bool(total.residual.shift) + bool(total.drop)
    elif total.half(rounding):
        additions += 1
    return {"add": additions, "multiply": products, "shift": shifts}


@dataclass(frozen=True)
class FixedProgram(ReadOnly):
    """Straight-line code on integers for one kernel.

    Parameters
    ----------
    program : Program
        The program in real numbers that it computes.
    interface : Interface
    body : tuple of Value
        The code.
    operations : mapping of str to int
        Integer operations of one call.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> fixed = algorithm("euler").quantize(word=16)
    >>> fixed.name, str(fixed.formats["state"])
    ('euler_rk4_2_w16', 'Q1.14')
    """

    program: Program
    interface: Interface
    body: tuple[Value, ...]
    operations: Mapping[str, int]

    __repr__ = short_repr
    _repr_html_ = notebook_html

    def _in_words(self) -> str:
        formats = ", ".join(
            f"{a.signal.name} {a.format}" for a in (*self.interface.inputs, *self.interface.outputs)
        )
        bounds = ", ".join(f"{name} {above(bound, 3, 'e')}" for name, bound in self.error_bounds.items())
        return f"{self.name}: {self.program.title}\n{formats}\nerror bounds of a call: {bounds}"

    @property
    def info(self) -> KernelInfo:
        """Metadata of the kernel."""
        return self.program.info

    @property
    def word(self) -> int:
        """Bits of a word."""
        return self.interface.settings.word

    @property
    def name(self) -> str:
        """Name in generated code."""
        return f"{self.program.name}_w{self.word}"

    @property
    def temporaries(self) -> int:
        """Number of values that are not elements of an output."""
        held = {name for argument in self.interface.outputs for name in argument.values}
        return sum(value.name not in held for value in self.body)

    @property
    def formats(self) -> dict[str, Format]:
        """Format of every argument and value, by name; wide numbers are twice as long as words."""
        known = {a.signal.name: a.format for a in (*self.interface.inputs, *self.interface.outputs)}
        return known | {v.name: Format(self.word * (1 + v.wide), v.fraction) for v in self.body}

    @property
    def ranges(self) -> dict[str, tuple[Fraction, Fraction]]:
        """Proved range of every argument and value, by name; it includes the offset of the value."""
        known = {
            a.signal.name: (a.low * a.unit, a.high * a.unit)
            for a in (*self.interface.inputs, *self.interface.outputs)
        }
        for value in self.body:
            unit = Fraction(2) ** -value.fraction
            known[value.name] = (value.offset + value.low * unit, value.offset + value.high * unit)
        return known

    @property
    def error_bounds(self) -> dict[str, Fraction]:
        """Error bound of every output after one call: that of its worst element, in units of the value."""
        return {argument.signal.name: max(argument.errors) for argument in self.interface.outputs}

    def as_data(self) -> dict[str, Any]:
        """Return formats, ranges and error bounds as plain JSON data."""
        adds_up, as_angle = self.interface.accumulation, self.interface.angle_accumulation
        elements = (
            zip(argument.signal.elements, argument.errors, strict=True) for argument in self.interface.outputs
        )
        return {
            "settings": self.interface.settings.as_dict(),
            "formats": {name: str(format_) for name, format_ in self.formats.items()},
            "ranges": {
                name: [float_below(low), float_above(high)] for name, (low, high) in self.ranges.items()
            },
            "error_bound": {name: float_above(bound) for name, bound in self.error_bounds.items()},
            "error_bound_by_element": {
                name: float_above(error) for pairs in elements for name, error in pairs
            },
            "integer_operations": self.operations,
            "accumulation": adds_up and {name: float_above(value) for name, value in asdict(adds_up).items()},
            "angle_accumulation": as_angle
            and {
                name: (float_below if name in ("shortest", "start") else float_above)(value)
                if isinstance(value, Fraction)
                else value
                for name, value in asdict(as_angle).items()
            },
        }
