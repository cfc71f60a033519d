"""Fixes ranges and formats that follow from inputs, user and results alone, before any quantity becomes an integer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import (
    ExactOperation,
    InputElement,
    Quantities,
    Sum,
    exponent,
    is_power_of_two,
)
from strapgen.fixedpoint.sensor_scale import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import ROTATION_INPUTS, Settings, rounded_limit
from strapgen.ir.formats import Format, finest
from strapgen.ir.integer_program import Value
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Program, Result
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor

#: Bits that inputs may be stored below their finest format, so that sums of them are exact.
MOST_GUARD_BITS = 3


@dataclass(frozen=True)
class FormatPlan:
    """The formats that are fixed before anything is lowered."""

    inputs: tuple[Argument, ...]
    values: Mapping[str, Value]  # the elements of the inputs
    forced: Mapping[str, int]  # fraction bits that the user states, or that the elements of a result share
    words: frozenset[str]  # quantities that must be rounded to words: these, and the factors and divisors


def format_plan(
    program: Program,
    settings: Settings,
    limits: Sequence[Limit],
    quantities: Quantities,
    guard_bits: int,
) -> FormatPlan:
    """Fix the formats that follow from inputs, user and results, with `guard_bits` below an input's finest format."""
    values: dict[str, Value] = {}
    inputs: list[Argument] = []
    for limit in limits:
        signal = limit.signal
        fraction, top = limit.places(guard_bits), limit.largest_integer(guard_bits)
        exact = Fraction(0)
        for name in signal.elements:
            values[name] = Value(name, None, fraction, False, -top, top, exact, exact, top)
        inputs.append(limit.argument(guard_bits))
    forced = _stated_formats(program, settings, quantities)
    for result in program.results:
        names = [name for name in quantities.results[result.signal.name] if isinstance(name, str)]
        fraction = _result_fraction(program, settings, quantities, inputs, result)
        forced |= {name: forced.get(name, fraction) for name in names}
    divisors = {
        str(quantity.definition.arguments[1])
        for quantity in quantities.items.values()
        if isinstance(quantity.definition, ExactOperation) and quantity.definition.kind == "divide"
    }
    words = frozenset(forced) | quantities.factors() | divisors
    return FormatPlan(tuple(inputs), values, forced, words)


def carried_input(program: Program, inputs: Sequence[Argument], signal: Signal) -> Argument | None:
    """Return the input that an output is in the next call."""
    name = program.recursion.inputs.get(signal.name) if program.recursion else None
    return next((argument for argument in inputs if argument.signal.name == name), None)


def sums_of_inputs_are_exact(plan: FormatPlan, quantities: Quantities, word: int) -> bool:
    """Return whether every sum of inputs that is needed as a word is one without rounding.

    A rounding error of a sum of inputs would be the same in every step of a steady motion.
    """
    for name, quantity in quantities.items.items():
        definition = quantity.definition
        if name not in plan.words or name in plan.forced or not isinstance(definition, Sum):
            continue
        if not _is_sum_of_inputs(definition, quantities):
            continue
        needed = max(plan.values[m[0]].fraction - exponent(c) for m, c in definition.terms)
        if needed > finest(quantity.range.magnitude, word):
            return False
    return True


def _is_sum_of_inputs(definition: Sum, quantities: Quantities) -> bool:
    """Return whether a sum is one of inputs times powers of two."""
    return all(
        len(monomial) == 1
        and is_power_of_two(coefficient)
        and isinstance(quantities.items[monomial[0]].definition, InputElement)
        for monomial, coefficient in definition.terms
    )


def _stated_formats(program: Program, settings: Settings, quantities: Quantities) -> dict[str, int]:
    """Return the fraction bits of the quantities whose format the user states one by one."""
    arguments = ["state", *(signal.name for signal in program.inputs)]
    arguments += [result.signal.name for result in program.results]
    stated: dict[str, int] = {}
    for name, text in settings.formats.items():
        if name in arguments:
            continue
        if name not in quantities.items:
            values = ", ".join(dict.fromkeys([*arguments, *quantities.items]))
            raise InputError(f"{program.kernel} has no value {name!r}; its values are: {values}")
        if isinstance(quantities.items[name].definition, InputElement):
            raise InputError(f"the format of {name} is that of its input; give the format of the whole input")
        stated[name] = Format.parse(text, settings.word).fraction
    return stated


def _result_fraction(
    program: Program,
    settings: Settings,
    quantities: Quantities,
    inputs: Sequence[Argument],
    result: Result,
) -> int:
    """Return the fraction bits that the elements of a result share."""
    signal, word = result.signal, settings.word
    is_output = result in program.outputs
    text = _stated_format(settings, signal) if is_output else settings.formats.get(signal.name)
    if text is not None:
        return Format.parse(text, word).fraction
    carried = carried_input(program, inputs, signal) if is_output else None
    if carried is not None:
        return carried.format.fraction
    if is_output and (signal.constraint or program.attitude_step is not None):
        return _attitude_fraction(settings, inputs, signal)
    names = [name for name in quantities.results[signal.name] if isinstance(name, str)]
    sizes = sorted(quantities.items[name].range.magnitude for name in names) or [Fraction(1)]
    fraction = finest(sizes[-1] * (Fraction(1) + Fraction(1, 1 << (word - 4))), word)
    if settings.state and result is program.transition:
        # A state that fills its word leaves no room in sums of products: this has to.
        width = (program.inputs[0].shape or (1,))[-1]
        return fraction - (sum(sizes[-width:]) * Fraction(2) ** fraction >= 1 << word)
    return fraction


def _attitude_fraction(settings: Settings, inputs: Sequence[Argument], signal: Signal) -> int:
    """Return the fraction bits of an output that is an attitude: those of an input like it, or of every state."""
    for argument in inputs:
        if argument.signal.constraint == signal.constraint and argument.signal.shape == signal.shape:
            return argument.format.fraction
    return state_fraction(settings.word, Fraction(1) + settings.allowance)


@dataclass(frozen=True)
class Limit:
    """Range of one input as the user states it, and its finest format."""

    signal: Signal
    largest: Fraction  # largest magnitude of an element
    fraction: int  # fraction bits of the finest format, or of the one that the user states
    fixed: bool  # whether the user states it
    bits: int  # those of an element in memory: 8, 16, 32, 64 or a word
    sensor: Sensor | None = None  # the scale of the gyro whose counts these are

    def places(self, guard_bits: int) -> int:
        """Return the fraction bits of the input when so many bits are left for sums of inputs."""
        return self.fraction if self.fixed or self.signal.constraint else self.fraction - guard_bits

    def largest_integer(self, guard_bits: int) -> int:
        """Return the largest integer that is accepted: the limit of an attitude is rounded down, any other limit up."""
        scaled = self.largest * Fraction(2) ** self.places(guard_bits)
        return math.floor(scaled) if self.signal.constraint else math.ceil(scaled)

    def argument(self, guard_bits: int) -> Argument:
        """Return the input; a bound beyond the range of its type in memory needs no check."""
        top, exact = self.largest_integer(guard_bits), (Fraction(0),) * self.signal.size
        format_ = Format(self.bits, self.places(guard_bits))
        high = min(top, format_.largest)
        return Argument(self.signal, format_, self.signal.elements, -top, high, exact, self.sensor)

    def range(self, guard_bits: int) -> Interval:
        """Return the range of the accepted values."""
        return Interval.symmetric(self.largest_integer(guard_bits) / Fraction(2) ** self.places(guard_bits))


def limits(program: Program, settings: Settings) -> list[Limit]:
    """Return the range and the finest format of every input of a program."""
    unknown = set(settings.ranges) - {signal.name for signal in program.inputs}
    if unknown:
        names = ", ".join(signal.name for signal in program.inputs)
        raise InputError(f"{program.kernel} has no input {sorted(unknown)[0]!r}; its inputs are: {names}")
    word = settings.word
    stated: list[Limit] = []
    for signal in program.inputs:
        if signal.constraint and settings.state:
            stated.append(Limit(signal, Fraction(1), word - 1, True, word))
            continue
        largest = largest_magnitude(program, signal, settings)
        if signal in counted(program) and settings.input_bits is not None:
            stated.append(_counts_format(signal, largest, settings, settings.input_bits))
            continue
        text = _stated_format(settings, signal)
        if text is not None:
            fraction = Format.parse(text, word).fraction
            if largest * Fraction(2) ** fraction < 1:
                raise InputError(
                    f"format {text} of {signal.name} has steps larger than its range of +-{float(largest):.6g}"
                )
            if largest * Fraction(2) ** fraction > Format(word, fraction).largest:
                raise InputError(
                    f"format {text} of {signal.name} does not hold its range of +-{float(largest):.6g}"
                )
        elif signal.constraint:
            fraction = state_fraction(word, largest)
        else:
            fraction = finest(largest, word)
        stated.append(Limit(signal, largest, fraction, text is not None, word))
    return stated


def _counts_format(signal: Signal, largest: Fraction, settings: Settings, bits: int) -> Limit:
    """Return the range of increments of so many bits: counts of a gyro, or numbers in the format that fits best."""
    if signal.name in settings.formats:
        raise InputError(f"the format of {signal.name} follows from their bits; it takes no other")
    memory = min(settings.word, next(size for size in (8, 16, 32, 64) if bits <= size))
    sensor = settings.sensor
    if sensor is None:
        return Limit(signal, largest, finest(largest, bits), True, memory)
    # A limit of the gyro is that of its bits; one in rad is rounded up to a count.
    counts = min(math.ceil(largest / sensor.count), 1 << (bits - 1))
    return Limit(signal, counts / Fraction(2) ** sensor.fraction, sensor.fraction, True, memory, sensor)


def ranges_of_copies(program: Program, settings: Settings, copied: Mapping[str, str]) -> dict[str, Fraction]:
    """Return, by the name of a state that copies a counted input of the call before (`copied`), all that it may be."""
    if settings.input_bits is None:
        return {}
    accepted = {}
    for signal in counted(program):
        largest = largest_magnitude(program, signal, settings)
        argument = _counts_format(signal, largest, settings, settings.input_bits).argument(0)
        accepted[signal.name] = rounded_limit(max(-argument.low, argument.high) * argument.unit)
    return {state: accepted[name] for state, name in copied.items() if name in accepted}


def _stated_format(settings: Settings, signal: Signal) -> str | None:
    """Return the format that the user states for an argument, if any; "state" stands for every attitude."""
    if settings.state and signal.constraint:
        return str(Format(settings.word, settings.word - 1))
    return settings.formats.get(signal.name, settings.formats.get("state") if signal.constraint else None)


def state_fraction(word: int, largest: Fraction) -> int:
    """Return the fraction bits of a state: room up to 2, which no step inside the allowance can leave."""
    return min(word - 2, finest(largest, word))


def largest_magnitude(program: Program, signal: Signal, settings: Settings) -> Fraction:
    """Return the largest magnitude of the elements of an input."""
    if signal.limit is not None:
        return signal.limit
    if signal.name in settings.ranges:
        if signal.constraint or signal.name in ROTATION_INPUTS:
            raise InputError(
                f"the range of {signal.name} follows from the drift allowance and the largest angle; it takes no other"
            )
        return settings.ranges[signal.name]
    if signal.name in ROTATION_INPUTS:
        return settings.largest_angle
    if signal.constraint:
        return (signal.bound or Fraction(1)) + settings.allowance
    if signal.bound is not None:
        return signal.bound
    raise InputError(
        f"{program.kernel}: the range of input {signal.name} is not known; state its largest magnitude"
    )
