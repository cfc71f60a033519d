"""What a brief asks of an algorithm, and attitude steps, which answer it."""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple, Protocol

import numpy as np

from strapgen import pipeline
from strapgen.analysis.vibration import assessment
from strapgen.analysis.vibration.rectification import Rectification, rectified
from strapgen.catalogue import Choice
from strapgen.design.brief import DesignBrief
from strapgen.design.selection import causes
from strapgen.design.selection.causes import Rounding
from strapgen.ir.sources import Sources
from strapgen.lab import cost as costs
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
    """What an algorithm costs on a processor."""

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
        """Return what the fixed-point code costs on the processor of the brief."""

    def steady(self) -> Any:
        """Return the algorithm as `random_runs` runs it."""

    def run(self, motion: Motion, steps: int, record: Fraction | None = None) -> Run:
        """Run the algorithm in double on a motion."""

    def rounded_apart(self, motion: Motion, steps: int, carry: str) -> float:
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
        one = costs.cost(pipeline.compile(self.choice, "c-fixed", settings), self._brief.processor.cpu)
        executed = None if one.executed is None else one.executed / float(self.step)
        return ProcessorCost(float(one.code_bytes + one.constant_bytes), executed)

    def steady(self) -> Choice:
        """Return the choice."""
        return self.choice

    def run(self, motion: Motion, steps: int, record: Fraction | None = None) -> Run:
        """Run the step in double on a motion."""
        return simulate(backend(self.choice), motion, self.step, steps * self.step, record=record)

    def rounded_apart(self, motion: Motion, steps: int, carry: str) -> float:
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


class DescribedAlgorithm(Algorithm, Protocol):
    """An algorithm whose code is that of a described system."""

    def sources(self, command: str) -> Sources:
        """Return the C of the system; its header names the command."""

    def file(self) -> str:
        """Return the description."""
