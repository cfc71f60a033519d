"""Writes in words the contract of generated code on arguments, ranges and errors."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from strapgen.ir.fixed_settings import TURNING, Settings
from strapgen.ir.formats import Format, above, below, places_above
from strapgen.ir.integer_program import FixedProgram, Value
from strapgen.ir.interfaces import Argument, ErrorFeedback, Interface, RoundingAccumulation
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor


def argument_text(argument: Argument) -> str:
    """Return format, unit, range and error bound of an argument in words."""
    unit, signal = argument.unit, argument.signal
    if argument.sensor is None:
        parts = [f"format {argument.format}, unit {_power(argument.format.fraction, signal.unit)}"]
    else:
        parts = [_counts_text(argument, argument.sensor)]
    limits = f"{below(argument.low * unit)} to {above(argument.high * unit)}"
    parts.append(f"range {argument.low} to {argument.high} ({limits})")
    worst = max(argument.errors)
    bound = f"<= {above(worst)} ({places_above(worst / unit)} ulp)"
    if worst and argument.saturates:
        parts.append(
            f"saturates at both ends; error {bound}, where the exact value is from -1 to 1; beyond, at "
            "most the larger of this and its distance from the range"
        )
    elif worst:
        parts.append(f"error {bound}")
    elif any(name not in signal.elements for name in argument.values):
        parts.append("exact")
    return "; ".join(parts)


def _counts_text(argument: Argument, sensor: Sensor) -> str:
    """Return the scale of a gyro's counts in words."""
    exact = Fraction(f"{float(sensor.count):.17g}") == sensor.count
    return (
        f"counts of the gyro in {argument.format.word} bits; 1 count = {float(sensor.count):.{7 if exact else 17}g} "
        f"{argument.signal.unit} = {sensor.unit}"
    )


def generating(program: Program) -> str:
    """Return the command that generates a program, up to the target: ``strapgen generate`` or its own."""
    stated = program.arguments
    return stated if stated.startswith("strapgen ") else f"strapgen generate {stated}"


def command(fixed: FixedProgram, target: str) -> str:
    """Return the command that generates a fixed-point program, with all options."""
    stated = options(fixed.interface.settings, fixed.program.inputs)
    return f"{generating(fixed.program)} --target {target} {stated}"


def options(settings: Settings, inputs: Iterable[Signal] = (), *, keep_stated: bool = False) -> str:
    """Return settings as options of the command line, with the largest angle if one of the inputs has it.

    With `keep_stated` the options that it follows from are among them, whatever the inputs are.
    """
    words, largest = [f"--word {settings.word}"], ""
    if keep_stated and settings.stated:
        largest = settings.stated
        words.append(largest)
    elif any(signal.name in TURNING for signal in inputs):
        largest = settings.stated or f"--max-angle-rad {settings.largest_angle}"
        words.append(largest)
    if settings.sensor is not None and settings.sensor.stated not in largest:
        words.append(settings.sensor.stated)
    if settings.input_bits != settings.default_input_bits:
        words.append(f"--input-bits {settings.input_bits}")
    if settings.state:
        words.append(f"--state {settings.state}")
    words += [
        f"--rounding {settings.rounding}",
        f"--carry {settings.carry}",
        f"--drift-allowance {settings.allowance}",
    ]
    if settings.multiply != "product":
        words.append(f"--multiply {settings.multiply}")
        words += [f"--digits {settings.digits}"] * bool(settings.digits)
    words += [f"--range {name}={value}" for name, value in settings.ranges.items()]
    words += [f"--fix {name}={value}" for name, value in settings.formats.items()]
    return " ".join(words)


def _power(fraction: int, unit: str) -> str:
    return f"2^{-fraction}" if unit == "1" else f"2^{-fraction} {unit}"


def accumulation_text(accumulation: RoundingAccumulation, program: Program, state: str = "") -> str:
    """Return the bound of a run of N steps in words; `state` names a state that saturates."""
    what = "in the length of a row" if len(program.inputs[0].shape) == 2 else "in the length of the state"
    growth = accumulation.growth - 1
    stretched = f", times exp({above(growth)} N)" if growth else ""
    once = f"{above(accumulation.once)} + " if accumulation.once else ""
    only = ", as long as exact arithmetic keeps every element of the state from -1 to 1" if state else ""
    return f"({once}{above(accumulation.per_step)} N){stretched}, {what}{only}"


def upkeep_text(program: Program, interface: Interface | None = None, target: str = "c") -> str:
    """Return advice on normalizing the state of a step, before and after an error code; "" for another kernel."""
    if program.attitude_step is None or program.attitude_step.orthonormalize is None:
        return ""
    kernel = program.attitude_step.orthonormalize
    command = f"strapgen generate {kernel} --target {target}"
    proper = "orthogonal with rows of length 1" if len(program.inputs[0].shape) == 2 else "of length 1"
    if interface is None:
        return (
            f"A proper state is {proper}. Rounding and truncation errors accumulate: correct them from time to time "
            f"with the function of `{command}`."
        )
    saturates = any(argument.saturates for argument in interface.inputs)
    wider = "; the range of the output is wider than that of the input because it holds for every input in its range"
    sentences = [f"A proper state is {proper}{'' if saturates else wider}."]
    calls = interface.accumulation and interface.accumulation.calls_within(interface.settings.allowance)
    if calls and not saturates:
        sentences.append(
            f"From a proper state it takes at least {calls:,} calls until one is refused for the size of the state."
        )
    sentences.append(
        f"Normalize it before, with the function of `{command} {options(interface.companion_settings)}`. After an "
        "error code, the state is that before the call: normalize it and continue, without the rotation of that step, "
        "or restart from a known attitude."
    )
    return " ".join(sentences)


def residuals_text(residuals: tuple[ErrorFeedback, ...]) -> str:
    """Return the words of error feedback with their formats, in words."""
    parts = []
    for fraction in dict.fromkeys(feedback.fraction for feedback in residuals):
        names = [feedback.name for feedback in residuals if feedback.fraction == fraction]
        parts.append(f"{', '.join(names)} in units of 2^{-fraction}")
    return "; ".join(parts)


def guards_text(values: tuple[Value, ...]) -> str:
    """Return the intermediate values that are checked, with their ranges, in words."""
    names: dict[tuple[str, str], list[str]] = {}
    for value in values:
        unit = Fraction(2) ** -value.fraction
        limits = below(value.offset + value.low * unit), above(value.offset + value.high * unit)
        names.setdefault(limits, []).append(value.name)
    return "; ".join(f"{', '.join(held)} from {low} to {high}" for (low, high), held in names.items())


def elements_text(signal: Signal) -> str:
    """Return the order of a signal's elements in words, for a contract."""
    return (
        f"{signal.elements[0]}, ..., {signal.elements[-1]}" if signal.size > 4 else ", ".join(signal.elements)
    )


def range_text(signal: Signal) -> str:
    """Return the range of a signal in words, for a contract."""
    if signal.bound is None:
        return "any finite number"
    return f"any finite number; at most {signal.bound} in magnitude in normal use"


def operations_text(program: Program) -> str:
    """Return the operation count in words."""
    counts = ", ".join(f"{number} {kind}" for kind, number in program.operations.items() if number)
    return f"{counts or 'none'}; {program.temporaries} temporaries"


def value_text(value: Value, word: int) -> str:
    """Return format, range and error bound of a value in words, and the offset that is not stored."""
    unit = Fraction(2) ** -value.fraction
    format_ = Format(word * (1 + value.wide), value.fraction)
    error = f"error {above(value.error, 2)}" if value.error else "exact"
    low, high = below(value.low * unit, 3), above(value.high * unit, 3)
    offset = (
        f"; stores {value.name} {'-' if value.offset > 0 else '+'} {abs(value.offset)}"
        if value.offset
        else ""
    )
    return f"{format_}, {low} .. {high}, {error}{offset}"


def exact_text(value: Fraction) -> str:
    """Return an exact number as a fraction if that is short, otherwise with 17 digits."""
    text = str(value)
    return text if len(text) <= 24 else f"{float(value):.17g}"
