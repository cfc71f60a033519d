"""Predicts the drift of an algorithm by its causes: truncation, coning, rounding, quantization and noise.

Truncation is the drift at the largest rate, turning steadily; coning that under the vibration; rounding the certified
bound of the fixed-point code; quantization and noise are root mean squares of what the gyro's pulses and its random
walk leave after the time of the budget. All are lengths of vectors in deg/h.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import mpmath

from strapgen import pipeline
from strapgen.analysis.vibration import assessment
from strapgen.analysis.vibration.assessment import through_gyro
from strapgen.analysis.vibration.mean_rates import Assessment
from strapgen.analysis.vibration.rectification import Tone
from strapgen.catalogue import Choice
from strapgen.design.brief import DesignBrief, GyroBrief, LineEnvironment
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.quantization_noise import QuantizationNoise, quantization_noise
from strapgen.run import exact
from strapgen.run.backends import backend as attitude_backend

#: Deg/h in a rad/s, and rad in an arc second.
DEG_H = math.degrees(1) * 3600
_ARCSEC = math.radians(1) / 3600
#: A rational that a pulse in arc seconds becomes rad with: pi/648000 to 25 places.
_PI = Fraction(31415926535897932384626433, 10**25)
#: Error feedback that is tried, the cheapest first.
CARRIES = ("none", "full")
#: Bits of a word that are not behind the point of a state.
_STATE_PLACES = 2
#: Most lines whose sums and differences are searched for resonances.
MOST_LINES = 40


@dataclass(frozen=True)
class Rounding:
    """The certified drift of fixed-point code."""

    #: The bound over the time of the budget; None where none is known
    deg_h: float | None
    #: The error feedback of the code, see `Settings`
    carry: str
    #: Why there is no bound, in words; empty if there is one
    reason: str = ""


def truncation(choice: Choice, brief: DesignBrief) -> float:
    """Return the drift in deg/h of a steady turn at the largest rate, from one step in 40 digits."""
    backend = attitude_backend(choice, backend="exact")
    step = float(step_length(choice, brief.gyro))
    with mpmath.workdps(exact.DIGITS):
        angle = mpmath.radians(exact.number(brief.max_rate_deg_s)) * exact.number(
            step_length(choice, brief.gyro)
        )
        sample = [mpmath.mpf(0), mpmath.mpf(0), angle / choice.increments]
        row = sample * backend.samples_per_step
        *_, c = exact.attitudes(backend, [row])
        lost = angle - mpmath.atan2(c[3] - c[1], c[0] + c[4])
        turns = 2 * mpmath.pi
        lost -= turns * mpmath.nint(lost / turns)
    return abs(float(lost)) / step * DEG_H


def coning(choice: Choice, brief: DesignBrief) -> float:
    """Return the drift in deg/h that an algorithm computes under the vibration, less the true one, to second order."""
    return _mean_error(choice, brief, "drift") * DEG_H


def sculling(choice: Choice, brief: DesignBrief) -> float | None:
    """Return the error in m/s^2 of the sculling term that is dual to a step's coning term."""
    if brief.environment is None or not brief.environment.accelerates:
        return None
    try:
        return _mean_error(choice, brief, "sculling")
    except InputError:
        return None


def _mean_error(choice: Choice, brief: DesignBrief, quantity: str) -> float:
    """Return the length of the error of a mean rate."""
    if brief.environment is None:
        return 0.0
    return mean_error(assessment.of(choice, quantity), brief, step_length(choice, brief.gyro))


def mean_error(assessed: Assessment, brief: DesignBrief, step: Fraction, cycles: int | None = None) -> float:
    """Return the length of the error of a mean rate under the vibration, seen through the gyro.

    `step`: step in s; for a recursion its slow cycle.
    """
    if brief.environment is None:
        return 0.0
    return brief.environment.error(_through_gyro(assessed, brief), step, cycles)


def line_errors(
    assessed: Assessment, brief: DesignBrief, step: Fraction, cycles: int | None = None
) -> list[float]:
    """Return the errors in deg/h whose sum is the drift under lines: of the algorithm, then of the gyro, by line.

    There are none under a spectrum or a recording. Parameters are those of `mean_error`.
    """
    if not isinstance(brief.environment, LineEnvironment):
        return []
    plain, seen = (
        brief.environment.errors(one, step, cycles) for one in (assessed, _through_gyro(assessed, brief))
    )
    return [
        DEG_H * error for error in (*plain, *(both - alone for both, alone in zip(seen, plain, strict=True)))
    ]


def tones(brief: DesignBrief) -> list[Tone]:
    """Return the lines of a brief as its gyro passes them on; none under another vibration, or too many lines."""
    environment = brief.environment
    if not isinstance(environment, LineEnvironment) or len(environment.stated) > MOST_LINES:
        return []
    return [
        Tone(
            line.frequency_hz,
            (-1j * line.theta_x, -1j * line.theta_y * cmath.exp(1j * line.phase), 0),
            brief.gyro.gain(line.frequency_hz),
        )
        for line in environment.stated
    ]


def _through_gyro(assessed: Assessment, brief: DesignBrief) -> Assessment:
    """Return an assessment through the gyro of a brief."""
    return assessed if brief.gyro.seen is None else through_gyro(assessed, brief.gyro.seen)


def quantization(choice: Choice, brief: DesignBrief) -> float:
    """Return the root mean square of the drift in deg/h that the gyro's pulses leave in a turn at the largest rate."""
    if not brief.gyro.pulse_arcsec:
        return 0.0
    return pulse_drift(quantization_noise(choice), brief, step_length(choice, brief.gyro))


def over(brief: DesignBrief, seconds: Fraction | None) -> DesignBrief:
    """Return a brief with another time of the budget in s; the brief itself for None."""
    return brief if seconds is None else replace(brief, budget=replace(brief.budget, over_s=seconds))


def pulse_drift(noise: QuantizationNoise, brief: DesignBrief, step: Fraction) -> float:
    """Return the drift in deg/h of the noise of pulses over the time of the budget.

    `step`: step in s.
    """
    pulse = float(brief.gyro.pulse_arcsec) * _ARCSEC
    turn = math.radians(float(brief.max_rate_deg_s)) * float(step)
    steps = round(float(brief.budget.over_s) / float(step))
    return math.degrees(math.sqrt(noise.mean_square(pulse, steps * turn**2, steps))) / _hours(brief)


def noise(brief: DesignBrief) -> float:
    """Return the root mean square of the drift in deg/h that the gyro's random walk leaves, the same for all."""
    return math.sqrt(3) * brief.gyro.noise_deg_sqrt_h / math.sqrt(_hours(brief))


def rounding(choice: Choice, brief: DesignBrief, allowed: float) -> Rounding:
    """Return the certified drift of the fixed-point code with as little error feedback as meets a limit.

    `allowed`: the limit in deg/h; where no feedback meets it, the smallest bound is returned.
    """
    several = []
    for carry in CARRIES:
        if carry == CARRIES[0] and _least_without_feedback(choice, brief) > allowed:
            continue
        try:
            several.append(_certified_drift(choice, brief, carry))
        except InputError as error:
            several.append(Rounding(None, carry, str(error)))
        bound = several[-1].deg_h
        if bound is not None and bound <= allowed:
            break
    return min(several, key=lambda one: math.inf if one.deg_h is None else one.deg_h)


def _least_without_feedback(choice: Choice, brief: DesignBrief) -> float:
    """Return a lower limit in deg/h of bounds without error feedback: a unit in the last place of the state a step."""
    steps = float(brief.budget.over_s / step_length(choice, brief.gyro))
    return math.degrees(steps * 2.0 ** (_STATE_PLACES - brief.processor.word)) / _hours(brief)


def _certified_drift(choice: Choice, brief: DesignBrief, carry: str) -> Rounding:
    """Return the certified drift with some error feedback."""
    fixed = pipeline.fixed_program(choice, settings(choice, brief, carry))
    angles = fixed.interface.angle_accumulation
    if angles is None:
        return Rounding(None, carry, "no bound of a run is known")
    steps = math.ceil(brief.budget.over_s / step_length(choice, brief.gyro))
    bound = angles.bound(steps, 0, Fraction(0), not brief.gyro.pulse_arcsec, False)
    if not math.isfinite(bound):
        return Rounding(None, carry, "the words are too short for a bound")
    return Rounding(math.degrees(bound) / _hours(brief), carry)


def settings(choice: Choice, brief: DesignBrief, carry: str) -> Settings:
    """Return the settings of the fixed-point code: increments are the gyro's counts where it has pulses."""
    stated: dict[str, Any] = {
        "word": brief.processor.word,
        "max_rate_deg_s": brief.max_rate_deg_s,
        "step": step_length(choice, brief.gyro),
        "increments": choice.increments,
        "carry": carry,
    }
    if brief.gyro.pulse_arcsec:
        pulse = brief.gyro.pulse_arcsec * _PI / 648000
        stated |= {"lsb": f"{pulse.numerator}/{pulse.denominator}rad"}
        stated |= {"input_bits": brief.processor.word}
    return Settings.of(**stated)


def step_length(choice: Choice, gyro: GyroBrief) -> Fraction:
    """Return the length of a step in s."""
    assert choice.increments is not None, "a step of increments is chosen"
    return choice.increments / gyro.sample_hz


def _hours(brief: DesignBrief) -> float:
    return float(brief.budget.over_s) / 3600
