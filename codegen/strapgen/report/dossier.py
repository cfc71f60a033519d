"""Collects formulas, code, bounds and runs of one algorithm."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.catalogue import ALGORITHMS, Choice
from strapgen.design import frontier
from strapgen.design.frontier import Candidate, DriftAndCost
from strapgen.fixedpoint import can_lower
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel
from strapgen.lab.certificate.largest_rounding import LargestRounding, largest_rounding
from strapgen.lab.comparison import Comparisons, compare
from strapgen.lab.convergence import Convergence, LadderCase, measure_case
from strapgen.lab.motions.motions import GENERAL, Motion
from strapgen.lab.motions.users_motions import any_motion
from strapgen.lab.parallel_cases import side_by_side
from strapgen.lab.runs import Run, simulate
from strapgen.run.backends import BACKENDS, DEFAULT_BACKENDS, Backend, backend
from strapgen.targets.registry import TARGETS
from strapgen.thesis import thesis_tables
from strapgen.thesis.thesis_tables import TableEntry

Array = NDArray[np.float64]

#: The back end that the others are compared with: it shows all rounding.
REFERENCE = "exact"
#: The steps in s of the ladder on which the order is measured, and the length of its runs in s: those of the command.
LADDER, LADDER_DURATION = ("1/2", "1/4", "1/8", "1/16", "1/32", "1/64", "1/128"), "2"
#: The targets whose code is shown.
SHOWN = ("numpy", "c", "c-float", "c-fixed")

#: Most records of a history: a plot shows no more, and a page stays small.
MOST_RECORDS = 250


@dataclass(frozen=True)
class StepRuns:
    """Results of runs of an attitude step."""

    schedule: Schedule
    #: What ran
    backend: Backend
    profile: Motion
    #: Scale, skew and drift along the motion, in double
    run: Run
    #: Back ends beside exact arithmetic on the same increments
    comparison: Comparisons
    #: What rounding has made of the attitude at most, by back end, where it is certified
    certified: dict[str, LargestRounding]
    #: What back ends say whose numbers do not hold the run, by their names
    refused: dict[str, str]
    #: Those of back ends in fixed point
    settings: Settings
    #: Its errors on a ladder of steps, with the order that they show
    ladder: Convergence


@dataclass(frozen=True)
class AlgorithmDossier:
    """Formulas, code, bounds and runs of one kernel."""

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
    """Collect formulas, code and bounds of an algorithm, and run it if it is an attitude step.

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
        rows, refused = _compare(choice, backends, increments, truth, formats)
        certified = _certified(choice, [row.backend for row in rows], increments, formats)
    ladder = measure_case(LadderCase(choice, "exact", "coning", GENERAL, LADDER, LADDER_DURATION))
    return StepRuns(schedule, stepper, profile, run, rows, certified, refused, formats, ladder)


def _compare(
    choice: Choice, backends: Sequence[str], increments: Array, truth: Array, settings: Settings
) -> tuple[Comparisons, dict[str, str]]:
    """Compare back ends with exact arithmetic; where one of them refuses the run, each alone, with its refusal."""

    def rows(names: Sequence[str]) -> Comparisons:
        return compare(
            choice,
            backends=names,
            samples=increments,
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
                held = Comparisons([*held, *rows([name])])
            except InputError as error:
                refused[name] = str(error)
        return held, refused


def _certified(
    choice: Choice, names: Sequence[str], increments: Array, settings: Settings
) -> dict[str, LargestRounding]:
    """Certify runs of back ends on increments that each rounds to its format, as `compare` does."""
    fitted, found = settings.for_increments(float(np.abs(increments).max(initial=0.0))), {}
    for name in names:
        made = backend(choice, backend=name, settings=fitted if BACKENDS[name].fixed else None)
        taken = made.representable(increments)
        if (rounding := largest_rounding(made, made.propagate(taken), taken)) is not None:
            found[name] = rounding
    return found


@dataclass(frozen=True)
class Conditions:
    """A motion, the sampling rate of the gyro, and the duration of the runs."""

    #: Name of a motion, or the file of a user's
    motion: str = "coning"
    #: Its parameters, as the command line states them
    settings: Mapping[str, str] = field(default_factory=lambda: dict(GENERAL))
    #: Samples a second in Hz, and the length of the runs in s; an algorithm runs as many whole steps as that
    #: holds
    sample_hz: str = "100"
    duration: str = "20"

    def profile(self) -> Motion:
        """Return the motion, checked with its numbers."""
        checks.number("sample_hz", self.sample_hz, positive=True)
        checks.number("duration", self.duration, positive=True)
        return any_motion(self.motion, self.duration, self.settings)

    def words(self) -> str:
        """Return the run in words."""
        parameters = "".join(f", {key}={value}" for key, value in self.settings.items())
        return f"{self.motion}{parameters}; {self.duration} s at {self.sample_hz} Hz"

    @property
    def options(self) -> str:
        """The options of the command line that state the motion."""
        parameters = [f"{key}={value}" for key, value in self.settings.items()]
        return shlex.join(["--motion", self.motion, *(["--set", *parameters] if parameters else [])])

    def schedule(self, choice: Choice) -> Schedule:
        """Return the step of an algorithm, and how many of them it runs.

        >>> from strapgen.catalogue import choose
        >>> Conditions(duration="10").schedule(choose("euler", "rk4", 2)).options
        '--step 1/50 --duration 10'
        """
        hertz = checks.number("sample_hz", self.sample_hz, positive=True)
        duration = checks.number("duration", self.duration, positive=True)
        step = choice.increments_per_step / hertz
        every = -(-int(duration / step) // MOST_RECORDS)
        if not every:
            raise InputError(
                f"duration {float(duration):g} s is shorter than a step of {choice.kernel} at {float(hertz):g} Hz"
            )
        return Schedule(step, int(duration / step) // every * every, every)


@dataclass(frozen=True)
class Schedule:
    """The steps of a run."""

    #: In s
    step: Fraction
    #: How many there are, a multiple of `every`
    steps: int
    #: Steps from one record to the next
    every: int

    @property
    def duration(self) -> Fraction:
        """The length of the run in s."""
        return self.steps * self.step

    @property
    def record(self) -> Fraction:
        """The time from one record to the next in s."""
        return self.every * self.step

    @property
    def options(self) -> str:
        """The options of the command line that state step and duration."""
        return f"--step {self.step} --duration {self.duration}"


def compared(choices: Sequence[Choice], names: Sequence[str] = (frontier.EVERY,)) -> list[Candidate]:
    """Return algorithms to compare with some choices, and after them those of the choices that have a name.

    >>> from strapgen.catalogue import choose
    >>> [one.name for one in compared([choose("dcm", "rk4", 3)], ["magnus4:2"])]
    ['magnus4:2', 'rk4:3']
    """
    if all(choice.increments is None for choice in choices):
        return []
    chosen = [one for choice in choices if (one := candidate(choice)) is not None]
    return list(dict.fromkeys([*frontier.candidates(names), *chosen]))


def named(several: Sequence[Candidate], names: Sequence[str]) -> tuple[str, ...]:
    """Return arguments of `frontier.candidates`: the stated names, and algorithms that they do not include.

    >>> named(frontier.candidates(["magnus4:2", "rk4:3"]), ["magnus4:2"])
    ('magnus4:2', 'rk4:3')
    """
    stated = frontier.candidates(names) if several else []
    return (*names, *(one.name for one in several if one not in stated))


def candidate(choice: Choice) -> Candidate | None:
    """Return the method of an attitude step with its samples, or the Python file of a user's step."""
    if choice.increments is None:
        return None
    method = choice.method
    if choice.user_kernel is not None:
        method = pipeline.program(choice).arguments
        if not method.endswith(".py") or any(space in method for space in " \t"):
            return None  # built in Python, or with options of its own
    elif choice.name not in ALGORITHMS:
        return None
    if not isinstance(method, str):
        return None
    return Candidate(method, choice.increments, choice.previous, choice.ahead)


def in_tables(choice: Choice) -> bool:
    """Return whether the tables of the thesis have an algorithm.

    >>> from strapgen.catalogue import choose
    >>> in_tables(choose("dcm", "rk4", 2)), in_tables(choose("dcm", "rk3", 2))
    (True, False)
    """
    return choice in [
        Choice(name, f"rk{order}", 2) for name in thesis_tables.ALGORITHMS for order in thesis_tables.ORDERS
    ]


def tables(choices: Iterable[Choice], backends: tuple[str, ...]) -> list[TableEntry]:
    """Return the tables of the thesis where one of some choices stands in them; else nothing."""
    if not any(map(in_tables, choices)):
        return []
    for _ in thesis_tables.build_all(backends):
        pass
    return [*thesis_tables.run_tables(backends)]


def dossiers(
    cases: Sequence[tuple[Choice, Conditions, Settings | None, Sequence[str]]], jobs: int | None = None
) -> Iterator[AlgorithmDossier]:
    """Yield the dossiers of algorithms, whose cases are the parameters of `dossier`, as they are ready."""
    numbered = {str(place): case for place, case in enumerate(cases)}
    for _, known in side_by_side(_gather, numbered, jobs):
        yield known


def _gather(case: tuple[Any, ...]) -> AlgorithmDossier:
    return dossier(*case)


def drifts_and_costs(
    several: Sequence[Candidate], conditions: Conditions, jobs: int | None = None
) -> Iterator[DriftAndCost]:
    """Run algorithms on the motion of some conditions, and yield drift and cost of each."""
    yield from frontier.frontier(
        several, conditions.sample_hz, conditions.duration, jobs=jobs, motions=motions(conditions)
    )


def motions(conditions: Conditions) -> frontier.Motions:
    """Return the motion of some conditions under its name."""
    return {conditions.motion: (conditions.motion, conditions.settings)}
