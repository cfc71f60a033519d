"""Gathers what is known of one algorithm: formulas, code, bounds, and what runs of it say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.fixedpoint import can_lower
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel
from strapgen.lab.compare.comparison import Comparisons, compare
from strapgen.lab.converge.convergence import Convergence, LadderCase, measured
from strapgen.lab.motions.motions import GENERAL, Motion
from strapgen.lab.simulate.runs import Run, simulate
from strapgen.report.conditions import Conditions, Schedule
from strapgen.run.backends import DEFAULT_BACKENDS, Backend, backend
from strapgen.targets.registry import TARGETS

Array = NDArray[np.float64]

#: The back end that the others are compared with: it shows all rounding.
REFERENCE = "exact"
#: The steps in s of the ladder on which the order is measured, and the length of its runs in s: those of the command.
LADDER, LADDER_DURATION = ("1/2", "1/4", "1/8", "1/16", "1/32", "1/64", "1/128"), "2"
#: The targets whose code is shown.
SHOWN = ("numpy", "c", "c-float", "c-fixed")


@dataclass(frozen=True)
class StepRuns:
    """What runs of an attitude step say."""

    schedule: Schedule
    #: What ran
    backend: Backend
    profile: Motion
    #: Scale, skew and drift along the motion, in double
    run: Run
    #: Back ends beside exact arithmetic on the same increments
    comparison: Comparisons
    #: What back ends say whose numbers do not hold the run, by their names
    refused: dict[str, str]
    #: Those of back ends in fixed point
    settings: Settings
    #: Its errors on a ladder of steps, with the order that they show
    ladder: Convergence


@dataclass(frozen=True)
class AlgorithmDossier:
    """What is known of one kernel."""

    choice: Choice
    #: Its exact formulas
    kernel: Kernel
    #: Its straight-line code
    program: Program
    #: Its code by target; without those in fixed point where these need ranges that a user must state
    sources: dict[str, Sources]
    #: Its formats and bounds in fixed point
    fixed: FixedProgram | None
    #: Why there is none; "" where there is
    no_fixed: str
    #: None for a kernel that is no attitude step
    runs: StepRuns | None


def dossier(
    choice: Choice,
    conditions: Conditions | None = None,
    settings: Settings | None = None,
    backends: Sequence[str] = DEFAULT_BACKENDS,
) -> AlgorithmDossier:
    """Gather what is known of an algorithm, and run it if it is an attitude step.

    `settings`: word, largest increment and rounding of fixed point; by default 32 bits and 1/8 rad. Runs choose
    their formats for their own increments, with the same rounding.

    >>> from strapgen.catalogue import choose
    >>> known = dossier(choose("euler-product"))
    >>> known.program.operations["multiply"], known.runs is None
    (16, True)
    """
    kernel = pipeline.derive(choice)
    kernel.require_known()
    program = pipeline.program(choice)
    fixed, reason = None, ""
    try:
        fixed = pipeline.fixed_program(choice, settings or Settings())
    except InputError as error:
        if can_lower(program):
            raise  # the settings do not go with the kernel
        reason = str(error)
    sources = {
        name: pipeline.compile(choice, name, settings if TARGETS[name].fixed else None)
        for name in SHOWN
        if fixed is not None or not TARGETS[name].fixed
    }
    runs = None
    if choice.increments is not None and kernel.attitude_step is not None:
        runs = _runs(choice, conditions or Conditions(), settings, backends)
    return AlgorithmDossier(choice, kernel, program, sources, fixed, reason, runs)


def run_settings(settings: Settings | None) -> Settings:
    """Return settings of a run in fixed point: the rounding that a user states, and formats for its own increments."""
    return (
        Settings()
        if settings is None
        else replace(Settings(), rounding=settings.rounding, carry=settings.carry)
    )


def _runs(
    choice: Choice, conditions: Conditions, settings: Settings | None, backends: Sequence[str]
) -> StepRuns:
    profile, schedule = conditions.profile(), conditions.schedule(choice)
    formats = run_settings(settings)
    step, steps = schedule.step, schedule.steps
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        stepper = backend(choice)
        run = simulate(stepper, profile, step, schedule.duration, record=schedule.record)
        increments = profile.increments(
            step, steps, choice.increments_per_step, choice.previous, choice.ahead
        )
        truth = profile.attitude(np.arange(1 + steps) * float(step))
        rows, refused = _compared(choice, backends, increments, truth, formats)
    ladder = measured(LadderCase(choice, "exact", "coning", GENERAL, LADDER, LADDER_DURATION))
    return StepRuns(schedule, stepper, profile, run, rows, refused, formats, ladder)


def _compared(
    choice: Choice, backends: Sequence[str], increments: Array, truth: Array, settings: Settings
) -> tuple[Comparisons, dict[str, str]]:
    """Compare back ends with exact arithmetic; where one of them refuses the run, each alone, with its refusal."""

    def rows(names: Sequence[str]) -> Comparisons:
        return compare(
            choice,
            backends=names,
            increments=increments,
            reference=REFERENCE,
            truth=truth,
            settings=settings,
        )

    try:
        return rows(backends), {}
    except InputError:
        held, refused = Comparisons(), {}
        for name in backends:
            try:
                held += rows([name])
            except InputError as error:
                refused[name] = str(error)
        return held, refused
