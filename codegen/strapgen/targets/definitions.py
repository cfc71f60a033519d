"""The names that a generated header defines for code around it: version, formats, limits and first values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.targets.printer import Printer

_IDENTITY = "the identity attitude"


@dataclass(frozen=True)
class Macro:
    """A name that a header defines."""

    name: str
    value: str  # C text
    meaning: str
    type: str = ""  # of C; "" for the floating-point type of the file
    size: int = 0  # that of an array; 0 for a number


def of_fixed(fixed: FixedProgram, function: str, literal: Callable[..., str] | None = None) -> list[Macro]:
    """Return the definitions of fixed-point code, whose integers `literal` prints, by default `word_literal`."""
    literal = literal or word_literal
    interface, bits, head = fixed.interface, fixed.word, function.upper()
    arguments = (*interface.inputs, *interface.outputs)
    names = _upper(argument.signal for argument in arguments)
    result = []
    for argument in arguments:
        name = f"{head}_{names[argument.signal.name]}"
        if argument.sensor is None:
            fraction = str(argument.format.fraction)
            result.append(Macro(f"{name}_FRACTION_BITS", fraction, f"{argument.format}", "int"))
        result.append(Macro(f"{name}_UNIT", _double(argument.unit), _unit(argument), "double"))
        result += _limits(name, argument, literal)
    step = fixed.program.attitude_step
    if step is not None:
        state = interface.inputs[0].format
        words = ", ".join(literal(state.nearest(x), bits) for x in step.identity)
        size, kind = len(step.identity), f"int{bits}_t"
        result.append(Macro(f"{head}_IDENTITY", f"{{{words}}}", _IDENTITY, kind, size))
    if interface.residuals:
        first = ", ".join(literal(feedback.fresh, bits, signed=False) for feedback in interface.residuals)
        meaning, size = "the residuals before the first call", len(interface.residuals)
        result.append(Macro(f"{head}_FIRST_RESIDUALS", f"{{{first}}}", meaning, f"uint{bits}_t", size))
    return result


def of_program(program: Program, function: str, printer: Printer) -> list[Macro]:
    """Return the definitions of floating-point code."""
    step, head = program.attitude_step, function.upper()
    if step is None:
        return []
    numbers = ", ".join(printer.constant(x) for x in step.identity)
    return [Macro(f"{head}_IDENTITY", f"{{{numbers}}}", _IDENTITY, size=len(step.identity))]


def word_literal(value: int, bits: int, signed: bool = True) -> str:
    """Return an integer as a constant of C that has at least so many bits on every machine.

    >>> word_literal(-5, 16), word_literal(-(2**31), 32)
    ('-INT16_C(5)', '(-INT32_C(2147483647) - 1)')
    """
    if not signed:
        return f"UINT{bits}_C({value})"
    if not value:
        return "0"
    if value == -(1 << (bits - 1)):
        return f"(-INT{bits}_C({-value - 1}) - 1)"
    return f"{'-' if value < 0 else ''}INT{bits}_C({abs(value)})"


def _limits(name: str, argument: Argument, literal: Callable[..., str]) -> list[Macro]:
    """Return the range of the integers of an argument: one limit where it is symmetric."""
    limits = [("LOW", argument.low, "smallest integer"), ("HIGH", argument.high, "largest integer")]
    if argument.low == -argument.high:
        limits = [("LIMIT", argument.high, "largest magnitude")]
    bits = argument.format.word
    return [Macro(f"{name}_{end}", literal(n, bits), what, f"int{bits}_t") for end, n, what in limits]


def _upper(signals: Iterable[Signal]) -> dict[str, str]:
    """Return names in capital letters where these differ, for each signal by its name."""
    names = [signal.name for signal in signals]
    counts = Counter(name.upper() for name in names)
    return {name: name if counts[name.upper()] > 1 else name.upper() for name in names}


def _unit(argument: Argument) -> str:
    if argument.sensor is not None:
        return f"rad: a count of the gyro, {argument.sensor.unit}"
    unit = "" if argument.signal.unit == "1" else f" {argument.signal.unit}"
    return f"2^{-argument.format.fraction}{unit}"


def _double(value: Fraction) -> str:
    """Return the shortest literal that reads as the double nearest to a number."""
    text = repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"
