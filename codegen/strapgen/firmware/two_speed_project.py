"""Returns the files of a project that builds, runs and tests the C of an algorithm in two speeds."""

from __future__ import annotations

import random
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.cli.project_kinds import DEFAULT, kinds
from strapgen.firmware import project
from strapgen.firmware.fmu import archive, units
from strapgen.firmware.project import MotionRun, Project, two_speed_main
from strapgen.firmware.project import refuse_changed as refuse_changed
from strapgen.firmware.vectors import MODEL, SEED, ProgramEvaluator, vectors_of_choice
from strapgen.firmware.vectors_c import CycleTable, cycle_files
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.two_speed_runner import Cycles, Loops, LoopSources
from strapgen.navigation.two_speed.two_speed_sources import wiring
from strapgen.run.compiled_code import ModelEvaluator
from strapgen.run.evaluators import Array
from strapgen.run.kernel_sources import sources_of_program

#: Fast cycles in a slow cycle, slow cycles in a navigation cycle, and navigation cycles of the run that is tested.
FAST, SLOW, NAVIGATION = 4, 2, 4
#: Length of a fast cycle of the main program in s, and its navigation cycles.
_FAST_CYCLE, _CYCLES = Fraction(1, 400), 100
#: Parts of their ranges that samples of the tested run have, until no sum leaves its own.
_PARTS = (8, 32, 128, 512)


def project_files(
    algorithm: str,
    sculling: int = 2,
    target: str = "c",
    settings: Settings | None = None,
    *,
    kind: str = DEFAULT,
) -> Mapping[str, str | bytes]:
    """Return the files of a project around the C of an algorithm in two speeds."""
    command = project.with_kind(two_speed_sources.command(algorithm, sculling, target, settings), kind)
    if kind in archive.VERSIONS:
        unit = units.of_two_speeds(algorithm, sculling, target, settings, command)
        return archive.project_files(unit, kind)
    whole = two_speed_sources.sources(algorithm, sculling, target, settings)
    loops = two_speed_sources.loops(algorithm, sculling, target, settings)
    system = two_speed_sources.description(algorithm, sculling).system
    together = cycle_files(_cycle_table(whole, LoopSources(loops, system), command))
    tables = []
    for loop in loops:
        stated = None if loop.fixed is None else loop.fixed.settings
        tables.append(vectors_of_choice(Choice(loop.kernel), target, stated, kinds()[kind].vectors))
    conversions = [] if algorithm == "dcm" else [pipeline.compile(Choice(f"dcm-from-{algorithm}"), "c")]
    motion = project.motion_files(["coning-increments", "coning-truth"], conversions)
    step = _FAST_CYCLE * FAST
    largest = project.LARGEST
    if loops[0].fixed is not None:
        (argument,) = (a for a in loops[0].fixed.inputs if a.signal.name == "increment")
        largest = argument.high * argument.unit / project.PART
    run = MotionRun(
        project.decimal(largest / _FAST_CYCLE),
        project.decimal(step, 15),
        _CYCLES,
        conversions[0].function.name if conversions else "",
        FAST,
        SLOW,
    )
    main = two_speed_main(whole, loops, wiring(system, loops), command, run)
    return Project(whole, command, main, tables, together, motion).files(kind)


def _cycle_table(whole: Sources, parts: LoopSources, command: str) -> CycleTable:
    """Return a run of all loops on random samples, from the models of the loops."""
    loops, runner = parts.loops, _runner(whole, parts)
    for part in _PARTS:
        samples = _samples(runner, part, random.Random(SEED))
        start = _start(loops)
        cycles = Cycles(_arrays(samples, runner.number), _arrays(start, runner.number), FAST, SLOW)
        try:
            attitudes, changes = runner.run(cycles)
            break
        except InputError:
            if part == _PARTS[-1]:
                raise
    refused: tuple[int, ...] = ()
    if loops[0].fixed is not None:
        (argument,) = (a for a in loops[0].fixed.inputs if a.signal.name == "increment")
        refused = (argument.low - 1, 0, 0) if -argument.low < argument.format.largest else ()
    return CycleTable(
        whole,
        loops,
        runner.wires,
        command,
        FAST,
        SLOW,
        NAVIGATION,
        start["state"][0],
        samples,
        attitudes.tolist(),
        changes.tolist(),
        refused,
    )


def _runner(whole: Sources, parts: LoopSources) -> Loops:
    """Return a runner of the loops without their C: the integer models, or programs in one floating-point type."""
    loops = parts.loops
    if loops[0].fixed is not None:
        models = tuple(
            pipeline.compile(Choice(loop.kernel), MODEL, loop.fixed.settings)
            for loop in loops
            if loop.fixed is not None
        )
        return Loops(LoopSources(models, parts.system), ModelEvaluator)
    programs = tuple(sources_of_program(pipeline.program(Choice(loop.kernel)), "exact") for loop in loops)
    return Loops(LoopSources(programs, parts.system), lambda sources: ProgramEvaluator(sources, whole.target))


def _arrays(values: Mapping[str, Any], dtype: Any) -> dict[str, Array]:
    """Return rows as arrays; integers of long words as Python has them."""
    return {
        name: np.array(rows, object if isinstance(rows[0][0], int) else dtype)
        for name, rows in values.items()
    }


def _samples(runner: Loops, part: int, stream: random.Random) -> dict[str, list[tuple[Any, ...]]]:
    """Return random samples of every cycle, of at most a part of their ranges."""
    wires, loops = runner.wires, runner.sources.loops
    counts = (FAST * SLOW * NAVIGATION, SLOW * NAVIGATION)
    return {
        signal.name: [
            tuple(_draw(loops, signal, part, stream) for _ in range(signal.size)) for _ in range(count)
        ]
        for signals, count in zip(wires.samples[:2], counts, strict=True)
        for signal in signals
    }


def _draw(loops: tuple[Sources, ...], signal: Signal, part: int, stream: random.Random) -> Any:
    """Return a random element of a signal."""
    drawn = 2 * stream.random() - 1
    arguments = [a for loop in loops if loop.fixed for a in loop.fixed.inputs if a.signal.name == signal.name]
    if arguments:
        return int(drawn * arguments[0].high) // part
    value = drawn * (1.0 if signal.bound is None else float(signal.bound)) / part
    return float(np.float32(value))


def _start(loops: tuple[Sources, ...]) -> dict[str, list[list[Any]]]:
    """Return the memory at the start where it is not zero, with zeros for what the loops expect beside it."""
    slow = loops[1]
    size = slow.function.inputs[0].size
    one: Any = 1.0
    if slow.fixed is not None:
        one = round(1 / slow.fixed.inputs[0].format.unit)
    zero = one - one
    identity = [one if (place % 4 == 0 if size == 9 else place == 3) else zero for place in range(size)]
    return {"state": [identity], "previous_turn": [[zero] * 3], "previous_increment": [[zero] * 3]}
