"""A million steps on an emulated processor, and how far they end from ball arithmetic on the same integers.

The exact step is linear in the state, and products of transitions can be grouped at will: the balls of a pass are
multiplied in pairs, then pairs of pairs. So their radii grow with the number of levels, not with that of the steps.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.evidence.balls import ball, column_of, multiplied, outcome
from strapgen.evidence.motion_rows import motion_rows
from strapgen.evidence.same_bits import Draws, tool_of
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Tool, Verdict, verdict
from strapgen.ir.exceptions import CompilerError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.processors import RUNNERS
from strapgen.lab.runner_c import LongRun, long_run_files
from strapgen.storage.files import write_files
from strapgen.targets.contract import options

#: The step of the standard catalogue that takes a million steps.
STEP = "euler-rk4-2"
PROCESSOR = "cortex-m3"
#: With error feedback, and with formats for a gyro of 450 deg/s that is read 2000 times a second.
SETTINGS = Settings(carry="full", largest_angle=Fraction(1, 256))
#: Steps of a pass, and passes.
ROWS, PASSES = 10_000, 100
#: Parts of their range that the increments fill, and the largest noise in each.
_PART, _NOISE = 0.9, Fraction(1, 500)
#: Units in the last place from the exact state that are allowed, and the largest radius of a ball.
LARGEST_ERROR, LARGEST_RADIUS = 10, Fraction(1, 100)
#: Bits of the balls: a product of quaternions takes at most one of them away, and PASSES of them follow each other.
PRECISION = 384


@dataclass(frozen=True)
class _WithBalls(Tool):
    """An emulator beside a library of ball arithmetic."""

    def installed(self) -> bool:
        """Return whether both are there."""
        return super().installed() and importlib.util.find_spec("flint") is not None


def million_steps(subject: Subject, folder: Path) -> list[Verdict]:
    """Tell how far a million steps with error feedback end from exact arithmetic."""
    if subject.choice.kernel != STEP or (subject.settings or Settings()) != Settings():
        return []
    runner = RUNNERS[PROCESSOR]
    emulator = tool_of(runner)
    tool = _WithBalls(
        f"{emulator.name} and python-flint",
        emulator.commands,
        f"{emulator.package}, python-flint",
        lambda: f"{emulator.version()}, python-flint {importlib.metadata.version('python-flint')}",
    )
    place = folder / "million_steps"

    def judge() -> tuple[Result, str]:
        fed_back = Subject(subject.choice, SETTINGS)
        run = noisy_run(fed_back, ROWS, PASSES)
        write_files(place, {**run.sources.step_files, **long_run_files(run)})
        (place / runner.name).mkdir(exist_ok=True)
        try:
            said = runner.run(
                place / runner.name, [f"../{fed_back.name}.c", f"../long_run_{fed_back.name}.c"]
            )
        except CompilerError as error:
            return "fails", str(error)
        return compared(states_of(said), exact_states(fed_back, run), run)

    return [verdict(subject.name, f"error of a million steps: {runner.name}", tool, judge)]


def noisy_run(subject: Subject, rows: int, passes: int) -> LongRun:
    """Return a run along a motion that cones, with noise."""
    assert subject.sources.fixed is not None
    state, samples = subject.sources.fixed.inputs
    motion = tuple(row[state.signal.size :] for row in motion_rows(subject.sources.fixed, rows, _PART))
    return LongRun(subject.sources, motion, passes, int(samples.high * _NOISE))


def states_of(said: str) -> list[list[int]]:
    """Return the states that a program reports, up to the first call that is refused.

    >>> states_of("state 00000001 ffffffff")
    [[1, -1]]
    """
    rows = re.findall(r"^state((?: [0-9a-f]{8})+)", said, flags=re.MULTILINE)
    words = [[int(word, 16) for word in row.split()] for row in rows]
    return [[word - (word >> 31 << 32) for word in row] for row in words]


def exact_states(subject: Subject, run: LongRun) -> list[list[Any]]:
    """Return the state after every pass as balls that hold what exact arithmetic makes of the integers."""
    from flint import ctx

    sources = subject.sources
    assert sources.fixed is not None
    assert sources.attitude_step is not None
    product = pipeline.program(choose(str(sources.attitude_step.product)))
    transition = subject.program.transition_program()
    units = [argument.unit for argument in sources.fixed.inputs]
    integers = noisy_integers(run)
    with ctx.workprec(PRECISION):
        state, states = [ball(word * units[0]) for word in run.identity], []
        for _ in range(run.passes):
            rows = [next(integers) for _ in run.rows]
            columns = [column_of(column) * ball(units[1]) for column in zip(*rows, strict=True)]
            turns = outcome(transition, columns)
            turns = multiplied(product, turns)
            state = outcome(product, [*state, *turns])
            states.append(state)
    return states


def noisy_integers(run: LongRun) -> Iterator[list[int]]:
    """Yield the increments of each step, as the program draws them."""
    draws, width = Draws(), 2 * run.noise + 1
    for _ in range(run.passes):
        for row in run.rows:
            yield [value - run.noise + draws.draw() % width for value in row]


def compared(
    states: Sequence[Sequence[int]], exact: Sequence[Sequence[Any]], run: LongRun
) -> tuple[Result, str]:
    """Return whether states are as near to balls as is claimed, in units of the last place."""
    from flint import ctx

    assert run.sources.fixed is not None
    if len(states) < len(exact):
        return "fails", f"a step is refused in pass {len(states) + 1}"
    unit = run.sources.fixed.inputs[0].unit
    with ctx.workprec(PRECISION):
        apart = [
            element / ball(unit) - word
            for state, balls in zip(states, exact, strict=True)
            for word, element in zip(state, balls, strict=True)
        ]
        error = max(float(abs(distance).upper()) for distance in apart)
        radius = max(float(distance.rad()) for distance in apart)
    said = options(run.sources.fixed.settings, run.sources.function.inputs)
    near = error < LARGEST_ERROR and radius < LARGEST_RADIUS
    return "agrees" if near else "fails", (
        f"{len(run.rows) * run.passes} steps of coning with noise, formats of {said}: at most {error:.2f} units of "
        f"the last place from balls of a radius below 1e{_exponent(radius):+03d}"
    )


def _exponent(number: float) -> int:
    """Return the smallest power of ten above a number."""
    return int(f"{number:e}".partition("e")[2]) + 1
