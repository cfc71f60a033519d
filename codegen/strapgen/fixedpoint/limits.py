"""Range and finest format of every input, from the settings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.sensor_scale import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import TURNING, Settings, rounded_limit
from strapgen.ir.formats import Format, finest
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor


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
            stated.append(_counted(signal, largest, settings, settings.input_bits))
            continue
        text = stated_format(settings, signal)
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


def _counted(signal: Signal, largest: Fraction, settings: Settings, bits: int) -> Limit:
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
        argument = _counted(signal, largest, settings, settings.input_bits).argument(0)
        accepted[signal.name] = rounded_limit(max(-argument.low, argument.high) * argument.unit)
    return {state: accepted[name] for state, name in copied.items() if name in accepted}


def stated_format(settings: Settings, signal: Signal) -> str | None:
    """Return the format that the user states for an argument, if any; "state" stands for every attitude."""
    if settings.state and signal.constraint:
        return str(Format(settings.word, settings.word - 1))
    return settings.formats.get(signal.name, settings.formats.get("state") if signal.constraint else None)


def state_fraction(word: int, largest: Fraction) -> int:
    """Return the fraction bits of a state: room up to 2, which no step inside the allowance can leave."""
    return min(word - 2, finest(largest, word))


def largest_magnitude(program: Program, signal: Signal, settings: Settings) -> Fraction:
    """Return the largest magnitude of the elements of an input."""
    if signal.name in settings.ranges:
        if signal.constraint or signal.name in TURNING:
            raise InputError(
                f"the range of {signal.name} follows from the drift allowance and the largest angle; it takes no other"
            )
        return settings.ranges[signal.name]
    if signal.name in TURNING:
        return settings.largest_angle
    if signal.constraint:
        return (signal.bound or Fraction(1)) + settings.allowance
    if signal.bound is not None:
        return signal.bound
    raise InputError(
        f"{program.kernel}: the range of input {signal.name} is not known; state its largest magnitude"
    )
