"""The interface of fixed-point code: formats, ranges and error bounds of its arguments, and the error of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

from strapgen.ir.angle_accumulation import AngleAccumulation
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.sensor import Sensor
from strapgen.ir.signals import Signal


@dataclass(frozen=True)
class ErrorFeedback:
    """The bits below the last place of a value, which are fed back into the next call: a word without a sign.

    The sum starts from it in place of a constant for rounding, and the low bits of the sum are the next error feedback.
    A run starts from half a unit of the last place for rounding to the nearest, and from zero for truncation; every
    other word is allowed too.
    """

    name: str
    fraction: int  # bits
    shift: int  # to the fraction of the sum, at most 0: `word * 2**shift` is added, which drops bits
    fresh: int  # the word that a run starts from


@dataclass(frozen=True)
class Argument:
    """An input or an output of a fixed-point function."""

    signal: Signal
    format: Format
    values: tuple[str, ...]  # the value that holds each element
    #: The range of the integers: an input outside is refused, an output is proved to lie inside.
    low: int
    high: int
    errors: tuple[Fraction, ...]  # bound for each element of an output after one call; zeros for an input
    sensor: Sensor | None = None  # the scale of the gyro whose counts these are

    @property
    def unit(self) -> Fraction:
        """The value of the integer 1, in the unit of the signal."""
        return self.format.unit if self.sensor is None else self.sensor.count

    @property
    def saturates(self) -> bool:
        """Whether it is an attitude in -1 to 1 less a unit: a number beyond is stored as the nearer end."""
        return bool(self.signal.constraint) and self.format.fraction == self.format.word - 1


@dataclass(frozen=True)
class RoundingAccumulation:
    """The error of a run due to rounding, as the length of a state or of a row of a matrix."""

    once: Fraction
    per_step: Fraction
    input_rounding: Fraction  # for each step, if increments are rounded to their format first
    growth: Fraction  # largest factor by which a step stretches the error before it

    def bound(self, steps: int, rounded_inputs: bool = False, stretch: float | None = None) -> float:
        """Return a bound of the error after a number of steps; inf where no useful bound is known.

        With `rounded_inputs` increments are rounded to their format first; `stretch` is the largest factor by which all
        transitions together stretch a difference, where it is known better than by `growth`.

        >>> RoundingAccumulation(Fraction(1), Fraction(2), Fraction(0), Fraction(1)).bound(10)
        21.0
        """
        exponent = steps * float(self.growth - 1)
        if exponent > 100 and stretch is None:
            return math.inf
        exponent = min(exponent, 100.0)
        per_step = self.per_step + (self.input_rounding if rounded_inputs else 0)
        # (g^n - 1)/(g - 1) <= n exp(n (g - 1)); a part in a million covers the rounding of this line.
        stretched = math.exp(exponent) * (1 + 1e-6) if exponent else 1.0
        if stretch is not None:
            stretched = stretch
        return stretched * (float(self.once) + steps * float(per_step))

    def calls_within(self, allowance: Fraction) -> int:
        """Return the number of calls in which a state of length 1 is proved not to exceed 1 by more than an allowance.

        >>> a_step = RoundingAccumulation(Fraction(0), Fraction(1, 2**10), Fraction(0), Fraction(1))
        >>> a_step.calls_within(Fraction(1, 16))
        63
        """
        # An exact step stretches the state by at most `growth`, as it does the error before it.
        room, low, high = math.log1p(float(allowance)) * (1 - 1e-6), 0, 1 << 40
        while high - low > 1:
            steps = (low + high) // 2
            rounded = float(self.once) + steps * float(self.per_step)
            inside = math.log1p(rounded) + steps * float(self.growth - 1) <= room
            low, high = (steps, high) if inside else (low, steps)
        return low


@dataclass(frozen=True)
class Interface:
    """The facts that a caller of fixed-point code must know."""

    settings: Settings
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    residuals: tuple[ErrorFeedback, ...]
    accumulation: RoundingAccumulation | None  # of a step
    angle_accumulation: AngleAccumulation | None = None  # None where nothing is proved

    @property
    def normalized_within(self) -> int:
        """The most steps between normalizations that are proved to be accepted and to keep the state proper, or 0."""
        if self.accumulation is None or self.angle_accumulation is None:
            return 0
        return min(
            self.angle_accumulation.proved_steps, self.accumulation.calls_within(self.settings.allowance)
        )

    @property
    def companion_settings(self) -> Settings:
        """The settings of a kernel that works on the same state beside a step: an orthonormalization."""
        formats = {} if self.settings.state else {"state": str(self.inputs[0].format)}
        return replace(self.settings, ranges={}, formats=formats).without_counts()
