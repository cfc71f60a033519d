"""The candidate algorithms for a brief, and their predicted drifts and costs.

They are the methods of the catalogue, coefficients designed for the vibration, and the loops of two speeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from strapgen import catalogue, pipeline, registration
from strapgen.analysis.vibration import assessment
from strapgen.analysis.vibration.rectification import Rectification, rectified
from strapgen.catalogue import METHODS, Choice
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design import coning_design, family
from strapgen.design.brief import DesignBrief, LineEnvironment, SpectralEnvironment, read_brief
from strapgen.design.coning_design import ConingBrief, of_spectrum
from strapgen.design.family import FamilyBrief
from strapgen.design.filters import responses
from strapgen.design.frontier import Candidate
from strapgen.design.selection import causes
from strapgen.design.selection.causes import Rounding
from strapgen.ir import checks
from strapgen.lab.cost import cost
from strapgen.lab.motions.motions import Motion
from strapgen.lab.runs import Run, drift_between, simulate
from strapgen.run.backends import backend

#: Operations that cost next to nothing.
FREE = ("negate",)


#: Longest word whose rounding double shows, and most steps of a run in 40 digits, which takes their place.
_LONGEST_WORD, _MOST_STEPS = 32, 4000


def reference(brief: DesignBrief, steps: int) -> tuple[str, int]:
    """Return the back end beside which fixed point is run, and the steps of the run: words may be finer than double."""
    return ("numpy", steps) if brief.processor.word <= _LONGEST_WORD else ("exact", min(steps, _MOST_STEPS))


class ProcessorCost(NamedTuple):
    """Bytes and instructions of an algorithm on a processor."""

    #: Of code and constants
    bytes: float
    #: None where they cannot be counted
    instructions_per_s: float | None


class Algorithm(Protocol):
    """An algorithm for a brief. All drifts are in deg/h, and each `InputError` says why there is none."""

    @property
    def step(self) -> Fraction:
        """Time in s from one attitude to the next."""

    def operations_per_s(self) -> float:
        """Return additions, multiplications, divisions, roots, functions and choices."""

    def truncation(self) -> float:
        """Return the drift of a steady turn at the largest rate."""

    def coning(self) -> float:
        """Return the drift under the vibration, to second order in its angles."""

    def rectification(self) -> Rectification:
        """Return the error of the mean rate under lines, to fourth order in their angles."""

    def line_errors(self) -> list[float]:
        """Return the signed errors whose sum is the drift under lines, see `causes.line_errors`."""

    def sculling(self) -> float | None:
        """Return the error of the sculling term in m/s^2; None where there is none."""

    def quantization(self, over_s: Fraction | None = None) -> float:
        """Return the root mean square of the drift that pulses leave in a turn at the largest rate.

        `over_s`: time of the turn in s; by default that of the budget.
        """

    def rounding(self, allowed: float) -> Rounding:
        """Return the certified drift of the fixed-point code with as little error feedback as meets a limit."""

    def cost(self, carry: str) -> ProcessorCost:
        """Return the cost of the fixed-point code on the processor of the brief."""

    def steady(self) -> Any:
        """Return the algorithm as `random_runs` runs it."""

    def run(self, motion: Motion, steps: int, record: Fraction | None = None) -> Run:
        """Run the algorithm in double on a motion."""

    def rounding_drift(self, motion: Motion, steps: int, carry: str) -> float:
        """Return the drift between fixed point and its reference at the end of a run on a motion."""


class AttitudeStep:
    """An attitude step of the catalogue, for a brief: see `Algorithm`."""

    def __init__(self, choice: Choice, brief: DesignBrief) -> None:
        self.choice, self._brief = choice, brief

    @property
    def step(self) -> Fraction:
        """Time in s from one attitude to the next."""
        return causes.step_length(self.choice, self._brief.gyro)

    def operations_per_s(self) -> float:
        """Return the operations of the program in a second."""
        counts = pipeline.program(self.choice).operations
        return sum(number for kind, number in counts.items() if kind not in FREE) / float(self.step)

    def truncation(self) -> float:
        """Return the drift of a steady turn, see `causes.truncation`."""
        return causes.truncation(self.choice, self._brief)

    def coning(self) -> float:
        """Return the drift under the vibration, see `causes.coning`."""
        return causes.coning(self.choice, self._brief)

    def rectification(self) -> Rectification:
        """Return the error of the mean rate under lines, see `rectified`."""
        return rectified(self.choice, self.step, causes.tones(self._brief))

    def line_errors(self) -> list[float]:
        """Return the errors that add up, see `causes.line_errors`."""
        return causes.line_errors(assessment.of(self.choice, "drift"), self._brief, self.step)

    def sculling(self) -> float | None:
        """Return the error of the dual term, see `causes.sculling`."""
        return causes.sculling(self.choice, self._brief)

    def quantization(self, over_s: Fraction | None = None) -> float:
        """Return the noise of pulses, see `causes.quantization`."""
        return causes.quantization(self.choice, causes.over(self._brief, over_s))

    def rounding(self, allowed: float) -> Rounding:
        """Return the certified drift, see `causes.rounding`."""
        return causes.rounding(self.choice, self._brief, allowed)

    def cost(self, carry: str) -> ProcessorCost:
        """Return bytes and instructions of the C in fixed point."""
        settings = causes.settings(self.choice, self._brief, carry)
        one = cost(pipeline.compile(self.choice, "c-fixed", settings), self._brief.processor.cpu)
        executed = None if one.executed is None else one.executed / float(self.step)
        return ProcessorCost(float(one.code_bytes + one.constant_bytes), executed)

    def steady(self) -> Choice:
        """Return the choice."""
        return self.choice

    def run(self, motion: Motion, steps: int, record: Fraction | None = None) -> Run:
        """Run the step in double on a motion."""
        return simulate(backend(self.choice), motion, self.step, steps * self.step, record=record)

    def rounding_drift(self, motion: Motion, steps: int, carry: str) -> float:
        """Return the drift between the integer model and its reference, on the increments of the integer model."""
        name, steps = reference(self._brief, steps)
        choice, double = self.choice, backend(self.choice, backend=name)
        settings = causes.settings(choice, self._brief, carry)
        fixed = backend(choice, backend="fixed-model", settings=settings)
        row = fixed.representable(
            motion.increments(self.step, steps, choice.increments or 1, choice.previous, choice.ahead)
        )
        ends = [double.matrices(run.propagate(row)[-1:]) for run in (fixed, double)]
        return float(np.linalg.norm(drift_between(*ends)[-1])) / float(steps * self.step) * causes.DEG_H


#: The states that an algorithm can integrate.
STATES = ("euler", "dcm")
#: Samples of a step, from before it and from after it, of methods that are of use with several; every other method of
#: the catalogue has the samples that it needs.
_SAMPLES: dict[str, tuple[tuple[int, ...], ...]] = {
    "rk2": ((1,), (2,)),
    "rk4": ((1, 1), (2,), (4,), (1, 3)),
    "magnus4": ((1, 1), (2,), (3,), (1, 3)),
    "magnus6": ((3,), (4,), (3, 3)),
    "crouch-grossman3": ((2,), (3,)),
    "coning-uncompressed": ((3,), (4,)),
    "coning-compressed": ((1,), (1, 1), (1, 2), (1, 3), (2,), (3,), (4,), (5,), (6,), (8,)),
    "coning-combined": ((2, 1), (3,), (4,), (3, 3), (5, 3)),
    "coning-exact-rest": ((3,),),
    "coning-least-squares": ((4,), (3, 3), (1, 8)),
}
#: Highest order of a Taylor series that is tried: the next ones cost more, and truncation is below rounding by then.
_HIGHEST_TAYLOR = 8
#: Methods that are a reference, not an algorithm to fly.
_REFERENCES = ("fit-exact",)
#: The attitude in two speeds, and its fast cycles in a slow one.
TWO_SPEED = "two-speed"
_CYCLES = (2, 4, 8, 16)
#: Objectives and samples of coefficients that are designed for a spectrum: see `coning_design.design`.
_OBJECTIVES = ("worst", "random")
_DESIGNED = ((4, 0), (1, 3), (3, 3), (1, 8))
#: What the name of a method begins with that is designed for the brief.
TUNED = "tuned-"
#: Forms of filters that are designed, and the samples of each.
FORMS = ("window", "pair")
_FILTERS = {"window": ((1, 5, 5), (1, 7, 7), (1, 9, 9)), "pair": ((1, 8, 8), (2, 7, 7))}
#: The band by the highest frequency of the vibration, the widest one, and that up to which filters are exact on cubics.
_MARGIN, _WIDEST, _NARROW = 1.05, Fraction(5, 2), Fraction(3, 2)
#: Least noise by the rate: what is below rounds the solution of the equations.
_LEAST_NOISE = Fraction(1, 10**9)


def choice_of(candidate: Candidate, state: str, path: str) -> Choice:
    """Return the choice of a step, one that is integrated with a state of `STATES`.

    The method is one of the catalogue; or one that a design for the brief at a path gives: coefficients for its
    vibration, "tuned-worst" or "tuned-random", or filters for its band and gyro, "tuned-window" or "tuned-pair".
    """
    method = candidate.method
    if is_tuned_window(method):
        window = family.commit_filters(window_brief(read_brief(Path(path)), candidate))
        return catalogue.choose_step(state, window, candidate.increments)
    if method.startswith(TUNED):
        shape = design_coefficients(
            path, method.removeprefix(TUNED), candidate.increments, candidate.previous
        )
        return catalogue.choose_step(state, shape, candidate.increments, previous=candidate.previous)
    return catalogue.choose_step(
        state, method, candidate.increments, previous=candidate.previous, ahead=candidate.ahead
    )


def contenders(brief: DesignBrief, names: Iterable[str] | None = None) -> list[Candidate]:
    """Return the algorithms for a brief; of two speeds the increments are the fast cycles in a slow one.

    Coefficients are designed where the vibration has a spectrum that turns about two axes, and filters, windows and
    pairs, where it has a band.

    >>> from fractions import Fraction
    >>> from strapgen.design.brief import BudgetBrief, GyroBrief, ProcessorBrief
    >>> brief = DesignBrief(Fraction(70), None, GyroBrief(Fraction(100)), BudgetBrief(0.01), ProcessorBrief())
    >>> [one.name for one in contenders(brief) if one.method in ("rk4", "window-7-7")]
    ['rk4:1+1', 'rk4:2', 'rk4:4', 'rk4:1+3', 'window-7-7:1+7+7']
    """
    several = [
        Candidate(method, *samples)
        for method in METHODS
        if method not in _REFERENCES and not _is_long_taylor(method)
        for samples in _SAMPLES.get(method) or [_own_samples(method)]
    ]
    if any(registration.extensions("design.two-speed")):
        several += [Candidate(TWO_SPEED, cycles) for cycles in _CYCLES]
    if isinstance(brief.environment, SpectralEnvironment) and _has_coning(brief.environment):
        several += [
            Candidate(f"{TUNED}{objective}", *samples) for objective in _OBJECTIVES for samples in _DESIGNED
        ]
    if _band(brief) is not None:
        several += [Candidate(f"{TUNED}{form}", *samples) for form in FORMS for samples in _FILTERS[form]]
    if names is None:
        return several
    chosen: dict[Candidate, None] = {}
    for name in names:
        matching = [one for one in several if name in (one.method, one.name)]
        if not matching:
            checks.choice("method", name, list(dict.fromkeys(one.method for one in several)))
        chosen |= dict.fromkeys(matching)
    return list(chosen)


def _is_long_taylor(method: str) -> bool:
    return method.startswith("taylor") and int(method.removeprefix("taylor")) > _HIGHEST_TAYLOR


def _own_samples(method: str) -> tuple[int, int, int]:
    """Return the samples that a method needs."""
    choice = catalogue.choose_step(STATES[0], method, catalogue.enough(method))
    assert choice.increments is not None, "a step of increments is chosen"
    return choice.increments, choice.previous, choice.ahead


def _has_coning(environment: SpectralEnvironment) -> bool:
    return {"angle_x", "angle_y"} <= set(environment.spectrum.transfers)


def is_tuned_window(method: str) -> bool:
    """Return whether a method has filters that are designed for the brief.

    >>> is_tuned_window("tuned-pair"), is_tuned_window("tuned-worst"), is_tuned_window("window-7-7")
    (True, False, False)
    """
    return method.startswith(TUNED) and method.removeprefix(TUNED) in FORMS


def _band(brief: DesignBrief) -> Fraction | None:
    """Return the angular frequency in rad a sample up to which there is vibration; None without one, or too high."""
    environment = brief.environment
    if not isinstance(environment, LineEnvironment | SpectralEnvironment):
        return None
    band = Fraction(
        _MARGIN * 2 * math.pi * environment.highest_hz / float(brief.gyro.sample_hz)
    ).limit_denominator(1000)
    return band if band < _WIDEST else None


def window_brief(brief: DesignBrief, candidate: Candidate) -> FamilyBrief:
    """Return the requirements on the filters for the band, the spectrum, the noise and the gyro of a brief."""
    band, environment = _band(brief), brief.environment
    assert band is not None, "only these are tuned for"
    spectrum = None
    if isinstance(environment, SpectralEnvironment) and _has_coning(environment):
        spectrum = responses.weights(environment.spectrum, band, brief.gyro.sample_hz)
    taps = None
    if candidate.method == f"{TUNED}{FORMS[1]}":
        number = candidate.previous + candidate.increments // 2
        taps = number, number - 3 + candidate.increments
    noise = max(brief.gyro.noise_ratio(brief.max_rate_deg_s), _LEAST_NOISE)
    return FamilyBrief(
        candidate.previous,
        candidate.ahead,
        band,
        conditions=4 if band <= _NARROW else 2,
        gyro=brief.gyro.seen,
        noise=noise,
        spectrum=spectrum,
        increments=candidate.increments,
        taps=taps,
    )


@lru_cache(maxsize=16)
def design_coefficients(path: str, objective: str, samples: int, previous: int) -> ShapedConing:
    """Return the coefficients that are designed for the spectrum of a brief and for its gyro."""
    brief = read_brief(Path(path))
    assert isinstance(brief.environment, SpectralEnvironment), "only these are tuned for"
    lines = of_spectrum(brief.environment.spectrum, brief.gyro.sample_hz)
    return coning_design.design(ConingBrief(samples, previous, objective, lines=lines, gyro=brief.gyro.seen))


def algorithm_of(candidate: Candidate, state: str, brief: DesignBrief, path: str | Path) -> Algorithm:
    """Return an algorithm for a brief."""
    if candidate.method == TWO_SPEED:
        loops: Algorithm = registration.extension("design.two-speed", f"method {TWO_SPEED}")(
            state, candidate.increments, brief
        )
        return loops
    return AttitudeStep(choice_of(candidate, state, str(path)), brief)
