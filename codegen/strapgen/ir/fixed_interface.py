"""The interface of fixed-point code: formats, ranges and error bounds of its arguments, and how rounding adds up."""

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

    Parameters
    ----------
    name : str
    fraction : int
        Fraction bits.
    shift : int
        Places from its fraction to that of the sum, at most 0: ``word * 2**shift`` is added, which drops bits.
    fresh : int
        The word that a run starts from.
    """

    name: str
    fraction: int
    shift: int
    fresh: int


@dataclass(frozen=True)
class Argument:
    """An input or an output of a fixed-point function.

    Parameters
    ----------
    signal : Signal
    format : Format
    values : tuple of str
        The value that holds each element.
    low, high : int
        Range of the integers: an input outside is refused, an output is proved to lie inside.
    errors : tuple of Fraction
        Error bound of each element of an output after one call; of an input, zeros.
    sensor : Sensor or None
        The scale of the gyro whose counts these are.
    """

    signal: Signal
    format: Format
    values: tuple[str, ...]
    low: int
    high: int
    errors: tuple[Fraction, ...]
    sensor: Sensor | None = None

    @property
    def unit(self) -> Fraction:
        """What the integer 1 stands for, in the unit of the signal."""
        return self.format.unit if self.sensor is None else self.sensor.count

    @property
    def saturates(self) -> bool:
        """Whether it is an attitude in -1 to 1 less a unit: what lies beyond is stored as the nearer end."""
        return bool(self.signal.constraint) and self.format.fraction == self.format.word - 1


@dataclass(frozen=True)
class RoundingAccumulation:
    """How rounding adds up over the steps of a run, in the length of a state (of a row, for a matrix).

    Parameters
    ----------
    once : Fraction
        The part of the bound that does not depend on the number of steps.
    per_step : Fraction
        The part that every step adds.
    input_rounding : Fraction
        What every step adds if increments are rounded to their format first.
    growth : Fraction
        Largest factor by which a step stretches the error before it.
    """

    once: Fraction
    per_step: Fraction
    input_rounding: Fraction
    growth: Fraction

    def bound(self, steps: int, rounded_inputs: bool = False, stretch: float | None = None) -> float:
        """Return a bound of the error after a number of steps; inf where no useful bound is known.

        Parameters
        ----------
        steps : int
        rounded_inputs : bool, optional
            Whether increments are rounded to their format first.
        stretch : float, optional
            Largest factor by which all transitions of the run together stretch a difference, if a smaller one is known
            than `growth` tells.

        Examples
        --------
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
        """Return for how many steps at least the length of a state, 1 at first, exceeds 1 by no more than an allowance.

        Examples
        --------
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
    """The facts that a caller of fixed-point code must know.

    Parameters
    ----------
    settings : Settings
    inputs, outputs : tuple of Argument
    residuals : tuple of ErrorFeedback
        Error feedback, from call to call.
    accumulation : RoundingAccumulation or None
        How the rounding of a step adds up; None for other kernels.
    angle_accumulation : AngleAccumulation or None
        How it adds up as an angle; None where that is not proved.
    """

    settings: Settings
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    residuals: tuple[ErrorFeedback, ...]
    accumulation: RoundingAccumulation | None
    angle_accumulation: AngleAccumulation | None = None

    @property
    def normalized_within(self) -> int:
        """The most steps from a normalization to the next that are proved to be accepted and to keep the state proper.

        It is 0 where nothing is proved.
        """
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
