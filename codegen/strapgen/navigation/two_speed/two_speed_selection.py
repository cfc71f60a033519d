"""An attitude in two speeds, for a brief: a fast loop sums coning, a slow one turns the attitude.

The loops are stages of a described system, whose file follows from the brief. To the second power of the increments
they are a step that takes the samples of a slow cycle and one from before it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from strapgen import pipeline
from strapgen.analysis.vibration import assessment
from strapgen.analysis.vibration.rectification import (
    DEGREE,
    Oscillations,
    Rectification,
    Sampling,
    of_transition,
)
from strapgen.catalogue import Choice
from strapgen.design.brief import DesignBrief
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import FREE, ProcessorCost, reference
from strapgen.design.selection.causes import Rounding
from strapgen.fixedpoint.angle_accumulation import turning_of_matrices
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.kernel import power_series
from strapgen.kernel.power_series import Powers
from strapgen.lab.motions.motions import Motion
from strapgen.lab.quantization_noise import polynomial_noise
from strapgen.lab.runs import Run, drift_between
from strapgen.navigation.systems import system_file, system_generation
from strapgen.navigation.systems.budget import measured_budget
from strapgen.navigation.systems.fitting import GeneratedStages, fitted
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.system_runs import simulate_system
from strapgen.navigation.systems.wiring import Description, wired
from strapgen.run import exact
from strapgen.run.backends import evaluator

#: Kernels of the fast loop and of the slow one before the attitude is turned.
_FAST, _VECTOR = "coning-fast", "coning-slow"
#: Factor on ranges that leaves room for the rounding of sums.
_SPARE = Fraction(33, 32)
#: Parts of a rad/s to which the largest rate is rounded up.
_PARTS = 1024
_FILE = """\
# The attitude in two speeds, for a gyro of {hertz} Hz and rates up to {degrees} deg/s: the loops of P. G. Savage,
# Strapdown System Algorithms, AGARD Lecture Series 133 (1984), paper 3, equations (22), (26) and (9) to (14).

name = "{state}_two_speed"
title = "Attitude in two speeds"
sample_hz = "{hertz}"
outputs = ["update.state"]

[inputs.gyro]
unit = "rad"
frame = "b"
range = "{rate}*T"
meaning = "angle increment, body axes"

[[stage]]
name = "fast"
kernel = "coning-fast"
every = 1
wires = {{ increment = "gyro" }}
ranges = {{ angle_sum = "{angle}", coning = "{coning}" }}
{formats}
[[stage]]
name = "vector"
kernel = "coning-slow"
every = {cycles}
wires = {{ angle_sum = "fast.angle_sum", coning = "fast.coning" }}

[[stage]]
name = "update"
kernel = "{state}-update"
every = {cycles}
wires = {{ rotation_vector = "vector.rotation_vector" }}
"""


@dataclass(frozen=True, eq=False)
class TwoSpeedLoops:
    """An attitude in two speeds, for a brief: see `algorithm.Algorithm`."""

    #: "euler" or "dcm"
    state: str
    #: Fast cycles in a slow one
    increments: int
    brief: DesignBrief
    #: Samples from before a slow cycle, and from after it.
    previous: int = 1
    ahead: int = 0

    @property
    def step(self) -> Fraction:
        """Length of the slow cycle in s."""
        return self.increments / self.brief.gyro.sample_hz

    def operations_per_s(self) -> float:
        """Return the operations of all loops in a second."""
        total = 0.0
        for name, program in self._programs.items():
            count = sum(number for kind, number in program.operations.items() if kind not in FREE)
            total += count * float(self.brief.gyro.sample_hz if name == "fast" else 1 / self.step)
        return total

    @property
    def _programs(self) -> Mapping[str, Program]:
        names = {"fast": _FAST, "vector": _VECTOR, "update": f"{self.state}-update"}
        return {name: pipeline.program(Choice(kernel)) for name, kernel in names.items()}

    def truncation(self) -> float:
        """Return the drift of a steady turn at the largest rate, from one slow cycle in 40 digits."""
        programs = self._programs
        with mpmath.workdps(exact.DIGITS):
            rate = mpmath.radians(exact.number(self.brief.max_rate_deg_s))
            angle = rate * exact.number(self.step)
            samples = [[mpmath.mpf(0), mpmath.mpf(0), angle / self.increments]] * (self.increments + 1)
            vector = _rotation_vector(
                samples, exact.Interpreter(programs["fast"]).outputs, programs["vector"]
            )
            identity = [exact.number(Fraction(int(k in (0, 4, 8)))) for k in range(9)]
            start = identity if self.state == "dcm" else [mpmath.mpf(x) for x in (0, 0, 0, 1)]
            ends = exact.Interpreter(programs["update"])(start, vector)
            if self.state != "dcm":
                ends = exact.Interpreter(pipeline.program(Choice("dcm-from-euler")))(ends)
            lost = angle - mpmath.atan2(ends[3] - ends[1], ends[0] + ends[4])
            turns = 2 * mpmath.pi
            lost -= turns * mpmath.nint(lost / turns)
        return abs(float(lost)) / float(self.step) * causes.DEG_H

    def coning(self) -> float:
        """Return the drift under the vibration, of both loops together in closed form, to second order."""
        return (
            causes.mean_error(assessment.two_speed("drift"), self.brief, self.step, self.increments)
            * causes.DEG_H
        )

    def rectification(self) -> Rectification:
        """Return the error of the mean rate under lines, of a slow cycle as one step; see `rectified`."""
        sampling = Sampling(self.step, self.increments, range(-self.previous, self.increments))
        return of_transition(self._transition, sampling, causes.tones(self.brief))

    def _transition(self, samples: list[list[Powers]], ring: Oscillations) -> list[Powers]:
        """Return the direction cosine matrix after a slow cycle from no rotation, row by row."""

        def outputs(name: str, *inputs: Sequence[Powers]) -> dict[str, list[Powers]]:
            kernel = pipeline.derive(Choice(name))
            elements = [element for signal in kernel.inputs for element in signal.elements]
            values = [value for vector in inputs for value in vector]
            return power_series.outputs(kernel, dict(zip(elements, values, strict=True)), ring, DEGREE)

        vector = _rotation_vector(samples, partial(outputs, _FAST), self._programs["vector"])
        unit = range(0, 9, 4) if self.state == "dcm" else (3,)
        size = 9 if self.state == "dcm" else 4
        start = [power_series.constant(ring, int(k in unit), DEGREE) for k in range(size)]
        (after,) = outputs(f"{self.state}-update", start, vector).values()
        if self.state != "dcm":
            (after,) = outputs("dcm-from-euler", after).values()
        return after

    def line_errors(self) -> list[float]:
        """Return the errors that add up, see `causes.line_errors`."""
        return causes.line_errors(assessment.two_speed("drift"), self.brief, self.step, self.increments)

    def sculling(self) -> float | None:
        """Return the error of the sculling that loops of the same kind compute, in m/s^2."""
        if self.brief.environment is None or not self.brief.environment.accelerates:
            return None
        return causes.mean_error(assessment.two_speed("sculling"), self.brief, self.step, self.increments)

    def quantization(self, over_s: Fraction | None = None) -> float:
        """Return the noise of pulses, from the rotation vector as a polynomial."""
        if not self.brief.gyro.pulse_arcsec:
            return 0.0
        samples = [sp.Matrix(sp.symbols(f"d{k}x d{k}y d{k}z")) for k in range(self.increments + 1)]

        def outputs(*inputs: Sequence[sp.Expr]) -> dict[str, list[sp.Expr]]:
            values = {
                element: value
                for signal, elements in zip(self._programs["fast"].inputs, inputs, strict=True)
                for element, value in zip(signal.elements, elements, strict=True)
            }
            return self._programs["fast"].run(values, _rational)

        rotation = _rotation_vector(samples, outputs, self._programs["vector"])
        noise = polynomial_noise(rotation, samples, self.previous)
        return causes.pulse_drift(noise, causes.over(self.brief, over_s), self.step)

    def rounding(self, allowed: float) -> Rounding:
        """Return the certified drift of the loops in fixed point, without error feedback.

        The angle between the computed attitude and the exact one grows by the errors of a slow cycle: of the rotation
        vector, since a rotation turns by no more than its vector changes, and of the product with the attitude. As for
        steps, the attitude stays proper: see `AngleAccumulation`.
        """
        try:
            per_cycle = self._angle_of_a_cycle()
        except InputError as error:
            return Rounding(None, causes.CARRIES[0], str(error))
        cycles = math.ceil(self.brief.budget.over_s / self.step)
        hours = float(self.brief.budget.over_s) / 3600
        return Rounding(math.degrees(cycles * per_cycle * (1 + 1e-9)) / hours, causes.CARRIES[0])

    def _angle_of_a_cycle(self) -> float:
        """Return how far rounding turns the attitude in a slow cycle, at most, in rad."""
        errors = {
            (name, argument.signal.name): [float(error) for error in argument.errors]
            for name, sources in self.fixed.sources.items()
            if sources.fixed is not None
            for argument in sources.fixed.outputs
        }
        if any(errors["fast", "next_angle_sum"]):
            raise InputError("the sum of the increments is rounded: the words are too short")
        arguments = self.fixed.arguments
        unit = float(arguments["gyro"].format.unit)
        sum_format = arguments["fast_angle_sum"]
        longest = math.sqrt(3) * float(sum_format.high * sum_format.format.unit)
        # A sample is off by at most a unit, and so is a sum, since what is left goes into the next sample.
        samples = math.sqrt(3) * unit * (1 + 2 * self.increments * longest)
        vector = self.increments * _length(errors["fast", "next_coning"])
        vector += _length(errors["vector", "rotation_vector"]) + samples
        local = _length(errors["update", "next"])
        proper = 1 - Settings().allowance
        shortest = float(proper)
        if local >= shortest / 2:
            raise InputError("the words are too short for a bound")
        if self.state != "dcm":
            return vector + 2 * math.asin(local / shortest)
        return vector + float(turning_of_matrices(proper)) * local / (shortest - local)

    @cached_property
    def fixed(self) -> GeneratedStages:
        """The generated loops in fixed point; samples have the format of their sum."""
        settings = Settings.of(word=self.brief.processor.word)
        loose = fitted(self._description(""), "c-fixed", settings)
        return fitted(self._description(self._formats(loose)), "c-fixed", settings)

    def _formats(self, loose: GeneratedStages) -> str:
        """Return the line of a file that has samples in the format of their sum."""
        text = loose.arguments["fast_angle_sum"].format
        return f'formats = {{ increment = "{text}", previous_increment = "{text}" }}\n'

    def file(self) -> str:
        """Return the file of the described system."""
        loose = fitted(self._description(""), "c-fixed", Settings.of(word=self.brief.processor.word))
        return self._file(self._formats(loose))

    def _file(self, formats: str) -> str:
        largest = math.radians(float(self.brief.max_rate_deg_s))
        rate = Fraction(math.ceil(largest * _PARTS), _PARTS)
        angle = rate * self.step * _SPARE
        return _FILE.format(
            hertz=self.brief.gyro.sample_hz,
            degrees=float(self.brief.max_rate_deg_s),
            state=self.state,
            rate=rate,
            angle=angle,
            coning=angle**2 / 2,
            cycles=self.increments,
            formats=formats,
        )

    def _description(self, formats: str) -> Description:
        return wired(system_file.parsed(tomllib.loads(self._file(formats), parse_float=Fraction)))

    def sources(self, command: str) -> Sources:
        """Return the C of the loops in fixed point."""
        return system_generation.unit(self.fixed, command)

    def cost(self, carry: str) -> ProcessorCost:
        """Return bytes and instructions of the loops in fixed point."""
        budget = measured_budget(self.fixed, self.brief.processor.cpu)
        executed = budget.executed_per_second
        return ProcessorCost(
            float((budget.code_bytes or 0) + budget.constant_bytes),
            None if executed is None else float(executed),
        )

    def steady(self) -> TwoSpeedLoops:
        """Return the loops themselves."""
        return self

    def runner(self) -> TwoSpeedLoops:
        """Return the object with `propagate` and `matrices`, see `random_runs.SteadyRuns`."""
        return self

    def propagate(self, increments: Any, record_every: int = 1, initial: Any = None) -> Any:
        """Run several runs side by side in double.

        `increments` (runs, cycles, 1 + N, 3): increments of every slow cycle in rad, after that before it.
        `initial` (runs, state shape): attitude at the start; by default no rotation. Returns (runs, 1 + records,
        state shape).
        """
        fast, vector, update = (evaluator(name) for name in (_FAST, _VECTOR, f"{self.state}-update"))
        shape = increments.shape[0], *((3, 3) if self.state == "dcm" else (4,))
        start = np.eye(3) if self.state == "dcm" else np.array([0.0, 0.0, 0.0, 1.0])
        attitude = np.broadcast_to(start, shape) if initial is None else initial
        records = [attitude]
        # The fast loop begins anew with every slow cycle: it runs through all of them side by side.
        total = coning = np.zeros_like(increments[:, :, 0])
        previous = increments[:, :, 0]
        for k in range(1, self.increments + 1):
            total, coning, previous = fast(total, coning, previous, increments[:, :, k])
        vectors = vector(total, coning)
        for cycle in range(increments.shape[1]):
            attitude = update(attitude, vectors[:, cycle])
            if (cycle + 1) % record_every == 0:
                records.append(attitude)
        return np.stack(records, axis=1)

    def matrices(self, states: Any) -> Any:
        """Return attitudes as direction cosine matrices."""
        return states if self.state == "dcm" else evaluator("dcm-from-euler")(states)

    def run(self, motion: Motion, steps: int, record: Fraction | None = None) -> Run:
        """Run the loops in double on a motion."""
        runner = system_runner(self._description(""), "numpy")
        return simulate_system(runner, motion, steps * self.step, record)

    def rounding_drift(self, motion: Motion, steps: int, carry: str) -> float:
        """Return the drift between the integer model and its reference on the same motion."""
        name, steps = reference(self.brief, steps)
        settings = Settings.of(word=self.brief.processor.word)
        description = self.fixed.description
        runners = system_runner(description, "fixed-model", settings), system_runner(description, name)
        ends = [simulate_system(runner, motion, steps * self.step).computed[-1:] for runner in runners]
        return float(np.linalg.norm(drift_between(*ends)[-1])) / float(steps * self.step) * causes.DEG_H


def _rotation_vector(samples: Sequence[Any], outputs: Any, slow: Program) -> list[Any]:
    """Return the rotation vector of a slow cycle from its samples, that before it first, by the fast loop."""
    zero = samples[0][0] * 0
    total, coning, previous = [zero] * 3, [zero] * 3, list(samples[0])
    for sample in samples[1:]:
        after = outputs(total, coning, previous, list(sample))
        total, coning = after["next_angle_sum"], after["next_coning"]
        previous = after["next_previous_increment"]
    values = dict(zip(slow.inputs[0].elements, total, strict=True))
    values |= zip(slow.inputs[1].elements, coning, strict=True)
    (vector,) = slow.run(values).values()
    return list(vector)


def _rational(value: Fraction) -> sp.Rational:
    return sp.Rational(value.numerator, value.denominator)


def _length(errors: Sequence[float]) -> float:
    return math.hypot(*errors)
