"""Writes in words the contract of generated code on arguments, ranges and errors."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial

from strapgen.ir.fixed_settings import ROTATION_INPUTS, Settings
from strapgen.ir.formats import Format, above, below, places_above
from strapgen.ir.integer_program import FixedProgram, Value
from strapgen.ir.interfaces import (
    LARGEST_ERROR,
    AngleAccumulation,
    Argument,
    Condition,
    ErrorFeedback,
    Interface,
    RoundingAccumulation,
    RoundingBounds,
)
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
    elif any(signal.name in ROTATION_INPUTS for signal in inputs):
        largest = settings.range_options
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


def _accumulation_text(accumulation: RoundingAccumulation, program: Program, state: str = "") -> str:
    """Return the bound of a run of N steps in words; `state` names a state that saturates."""
    what = "in the length of a row" if len(program.inputs[0].shape) == 2 else "in the length of the state"
    growth = accumulation.growth - 1
    stretched = f", times exp({above(growth)} N)" if growth else ""
    once = f"{above(accumulation.once)} + " if accumulation.once else ""
    only = ", as long as exact arithmetic keeps every element of the state from -1 to 1" if state else ""
    return f"({once}{above(accumulation.per_step)} N){stretched}, {what}{only}"


def upkeep_text(program: Program, interface: Interface | None = None, target: str = "c") -> str:
    """Return the instructions on normalizing the state of a step; "" for another kernel."""
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
    if signal.limit is not None:
        return f"at most {below(signal.limit)} in magnitude, as its error bounds and series need it"
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


#: Bounds are written with four digits.
_above, _below = partial(above, digits=4), partial(below, digits=4)
#: Steps from one normalization to the next in the examples, unless fewer are proved.
_APART = 1000
#: Units of the last place by which an element of an orthonormalization is off in the examples.
_UNITS = 4


def run_paragraphs(interface: Interface, program: Program) -> list[str]:
    """Return the bound of a run of N steps in words, and its values for some N; empty for other kernels than steps."""
    angles = interface.angle_accumulation
    if angles is not None:
        is_matrix = len(program.inputs[0].shape) == 2
        words = _matrix_words(angles) if is_matrix else _parameter_words(angles)
        return [*words, *_table(interface, angles)]
    if interface.accumulation is not None:
        return [
            "Over a run of N steps without orthonormalization the distance from exact arithmetic on the same "
            f"increments is at most {_accumulation_text(interface.accumulation, program, interface.settings.state)}."
        ]
    return []


def _parameter_words(angles: AngleAccumulation) -> list[str]:
    """Return the bound of a run of a vector of parameters in words."""
    return [
        f"Attitude error by rounding after N steps: at most {_formula(angles)} rad against exact arithmetic on the "
        f"same increments, while the length of the state is at least {_above(angles.shortest)}. From a length of at "
        f"least {_above(angles.start)} that is proved for {angles.proved_steps:,} steps. M normalizations in between, "
        "which multiply the words of the state by one factor and round each of them once, add at most "
        f"{_above(angles.per_normalization)} M rad.",
    ]


def _matrix_words(angles: AngleAccumulation) -> list[str]:
    """Return the bound of a run of a matrix in words."""
    inner, outer = angles.start**2, angles.shortest**2
    words = [
        "Error by rounding of the nearest rotation to the matrix C after N steps: at most "
        f"{_formula(angles)} rad against exact arithmetic on the same increments, for N up to "
        f"{angles.proved_steps:,} from a C whose C'C has eigenvalues from {_above(inner)} to {_below(2 - inner)}; over "
        f"more steps {_above(angles.beyond)} times as much, while they stay between {_above(outer)} and "
        f"{_below(2 - outer)}.",
    ]
    if angles.per_element is not None:
        fixed = f"{_above(angles.per_normalization)} + " if angles.per_normalization else ""
        words.append(
            "M orthonormalizations in between, at most as many steps apart, which multiply C by a symmetric expansion "
            f"of the inverse root of C'C, make {_above(angles.orthonormalized)} times as much of it and add at most "
            f"({fixed}{_above(angles.per_element)} h) M rad, with h the error of an element that their header states, "
            f"up to {_below(LARGEST_ERROR)}."
        )
    if angles.dual_rows_apart:
        words.append(
            f"With dual rows, as dcm_orthonormalize has them, at most {angles.dual_rows_apart} steps apart, h up to "
            f"{_below(angles.dual_rows_error)}, from a C'C with eigenvalues within {_below(angles.dual_rows_start)} "
            f"of 1, all that is exp({_above(angles.dual_rows_growth)} M) times as much."
        )
    return words


def _formula(angles: AngleAccumulation) -> str:
    once = f"{_above(angles.once)} + " if angles.once else ""
    return f"{once}{_above(angles.per_step)} N"


def _table(interface: Interface, angles: AngleAccumulation) -> list[str]:
    """Return the bounds of some runs, a line each."""
    apart = min(_APART, interface.normalized_within)
    is_restored = angles.per_element is not None and apart > 0
    error = _UNITS * interface.inputs[0].format.unit if angles.per_element else Fraction(0)
    to_first_order = f"orthonormalized to first order (h = {_UNITS} ulp)"
    kind = to_first_order if angles.per_element else "normalized"
    lines = []
    for steps, what in _runs(interface.settings.stated):
        line = f"- N = {steps}{what}: {_angle(angles.bound(steps))}"
        if is_restored:
            line += f"; {kind} every {apart} steps: {_angle(angles.bound(steps, steps // apart, error))}"
        lines.append(line)
    return lines


def _runs(stated: str) -> list[tuple[int, str]]:
    """Return numbers of steps for the examples; an hour where the step is stated."""
    runs = [(10**4, ""), (10**6, "")]
    step = re.search(r"--step (\S+)", stated)
    if step is not None:
        runs.append((int(3600 / Fraction(step[1])), ", an hour"))
    return sorted(runs)


def _angle(value: float) -> str:
    """Return a bound of an angle, unless it says nothing."""
    return f"{_above(Fraction(value))} rad" if value < math.pi else "no bound"


def with_names(bounds: RoundingBounds, program: Program, named: Program) -> RoundingBounds:
    """Return the bounds of a program with the names that are printed."""
    # A value on the way may have the name of an input or of an output.
    inputs = _rename([s.name for s in program.inputs], [s.name for s in named.inputs])
    values = _rename([a.name for a in program.body], [a.name for a in named.body])
    outputs = _rename([r.signal.name for r in program.outputs], [r.signal.name for r in named.outputs])

    def renamed(condition: Condition, names: dict[str, str]) -> Condition:
        words, space, name = condition.value.rpartition(" ")
        return replace(condition, value=words + space + names[name])

    return replace(
        bounds,
        inputs=tuple(renamed(condition, inputs) for condition in bounds.inputs),
        conditions=tuple(renamed(c, outputs | inputs | values) for c in bounds.conditions),
        errors={outputs[name]: errors for name, errors in bounds.errors.items()},
        any_order=bounds.any_order
        and replace(
            bounds.any_order,
            errors={outputs[name]: errors for name, errors in bounds.any_order.errors.items()},
        ),
    )


def _rename(names: list[str], printed: list[str]) -> dict[str, str]:
    return dict(zip(names, printed, strict=True))


def rounding_text(
    bounds: RoundingBounds,
    program: Program,
    flag: str = "-ffp-contract=off",
    library: str = "the C library",
) -> str:
    """Return the error bounds of a call and of a run, with their conditions, as sentences without the last full stop.

    `flag` keeps a compiler from fusing a product and a sum, "" where none does so; `library` computes the sines.
    """
    if bounds.reason:
        return f"no bound: {bounds.reason}"
    if not any(bounds.worst.values()):
        return "none; every output is exact"
    text = f"against exact arithmetic on the same inputs, {_errors(bounds.worst, bounds.unit)}"
    if bounds.accumulation is not None:
        text += _after_steps(program, bounds.accumulation.per_step, bounds.accumulation.growth)
    return f"{text}. This holds for {_conditions(bounds, flag, library)}"


def fast_math_text(bounds: RoundingBounds, program: Program) -> str:
    """Return what holds of code that is compiled with ``-ffast-math``, as a sentence without the last full stop."""
    order = bounds.any_order
    if order is None or not allows_fast_math(bounds, program):
        by_value = "numbers passed by value, which compilers take for finite"
        return f"refused; there is no bound for {(order and order.without) or by_value}"
    text = _errors(order.worst, bounds.unit)
    if order.per_step is not None and bounds.accumulation is not None:
        text += _after_steps(program, order.per_step, bounds.accumulation.growth)
    approximated = ", quotients and roots within 2 ulp" if order.approximates else ""
    return (
        f"{text}. This holds on the same ranges for any order of the operations, fused or not, with at most "
        f"{order.roundings} roundings from an input to an output{approximated}; subnormal numbers may be flushed to "
        "zero. An input that is not finite makes all outputs NaN"
    )


def allows_fast_math(bounds: RoundingBounds, program: Program) -> bool:
    """Return whether the code may be compiled with ``-ffast-math``."""
    order = bounds.any_order
    return order is not None and not order.without and all(signal.shape for signal in program.inputs)


def _after_steps(program: Program, per_step: Fraction, growth: Fraction) -> str:
    """Return the error of a run of N steps."""
    row = "row of the error" if len(program.inputs[0].shape) == 2 else "error"
    stretched = f" exp({above(growth - 1)} N)" if growth > 1 else ""
    return f"; the {row} after N steps is at most {above(per_step)} N{stretched} long"


def _errors(largest: Mapping[str, Fraction], unit: Fraction) -> str:
    """Return the largest error of every output."""
    parts = [
        f"error of {name} <= {above(worst)}" if worst else f"{name} is exact"
        for name, worst in largest.items()
    ]
    if len(parts) == 1:
        parts[0] += f" ({above(max(largest.values()) / unit)} ulp of 1)"
    return ", ".join(parts)


def _conditions(bounds: RoundingBounds, flag: str, library: str) -> str:
    """Return the conditions of the bounds."""
    sizes: dict[str, list[str]] = {}
    for condition in bounds.inputs:
        sizes.setdefault(f"up to {below(condition.high)}", []).append(condition.value)
    for condition in bounds.conditions:
        limits = f"from {above(condition.low)} to {below(condition.high)}"
        sizes.setdefault(limits, []).append(condition.value)
    parts = [f"{', '.join(names)} {size}" for size, names in sizes.items()]
    if bounds.functions:
        names = " and ".join(bounds.functions)
        parts.append(f"{names} of {library} within 1 ulp")
    parts += ["IEEE 754, each operation rounded to the nearest", *filter(None, [flag])]
    return "; ".join(parts)
