"""Returns the files of a project that builds, runs and tests generated C on any machine with CMake."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.firmware.changed_files import refuse_changed as refuse_changed
from strapgen.firmware.project.project_c import MOTION, MotionRun, call_main, cmake, step_main
from strapgen.firmware.vectors.vectors import vectors_of_choice
from strapgen.firmware.vectors.vectors_c import table_files
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.run.kernel_sources import StepSources
from strapgen.targets.contract import options
from strapgen.targets.names import UNNAMED, Naming

#: Steps of the run of a main program.
STEPS = 200
#: Step of that run in s where the settings state none, and part of the largest increment that it has.
_STEP, PART = Fraction(1, 100), 16
#: Largest increment of that run where none is stated, in rad: 25 deg/s over 0.01 s, in two increments.
LARGEST = Fraction(1, 458)


def project_files(
    choice: Choice, target: str, settings: Settings | None = None, naming: Naming = UNNAMED
) -> dict[str, str]:
    """Return the files that build and test the C of a kernel, without those of the kernel itself."""
    table = vectors_of_choice(choice, target, settings, naming=naming)
    sources = table.sources
    command = f"strapgen generate {naming.of(pipeline.program(choice)).arguments} --target {target}"
    if sources.fixed is not None:
        command += f" {options(sources.fixed.settings, sources.function.inputs)}"
    command += " --project"
    tests = table_files(table)
    motion: dict[str, str] = {}
    steps = sources.attitude_step is not None and sources.function.inputs[-1].name == "increments"
    kernel = _conversion(sources)
    if steps and kernel is not None:
        conversion = StepSources(sources, choice).sources(kernel, "c") if kernel else None
        motion = motion_files(["coning-increments", "coning-truth"], [conversion] if conversion else [])
        run = coning_run(sources, conversion.function.name if conversion else "")
        main = step_main(sources, command, run)
    else:
        main = call_main(table, command)
    return assembled(sources, command, main, motion, tests)


def _conversion(sources: Sources) -> str | None:
    """Return the kernel that turns a step's state into a matrix, "" where it is one; None where nothing does."""
    if sources.attitude_step is None:
        return None
    if sources.attitude_step.attitude is not None:
        return sources.attitude_step.attitude
    return "" if sources.function.inputs[0].constraint == "rotation" else None


def assembled(
    sources: Sources, command: str, main: str, motion: Mapping[str, str], tests: Mapping[str, str]
) -> dict[str, str]:
    """Return the files of a project with its CMakeLists.txt."""
    text = cmake(
        sources,
        command,
        [file for file in motion if file.endswith(".c")],
        [Path(file).stem for file in tests if file.endswith(".c")],
    )
    return {"CMakeLists.txt": text, "main.c": main, **tests, **motion}


def motion_files(kernels: Iterable[str], others: Iterable[Sources]) -> dict[str, str]:
    """Return the C in double of kernels of the catalogue, and of others, in a folder of their own."""
    parts = [*(pipeline.compile(Choice(kernel), "c") for kernel in kernels), *others]
    return {f"{MOTION}/{file}": text for part in parts for file, text in part.step_files.items()}


def coning_run(sources: Sources, conversion: str) -> MotionRun:
    """Return a run of a step on coning whose increments lie well inside the range of its input."""
    assert sources.attitude_step is not None
    signal = sources.function.inputs[-1]
    samples = signal.size // 3 - sources.attitude_step.beside
    largest, step = LARGEST, _STEP
    if sources.fixed is not None:
        argument = sources.fixed.inputs[-1]
        largest = argument.high * argument.unit / PART
        step = stated_step(sources.fixed.settings)
    return MotionRun(decimal(largest * samples / step), decimal(step, 15), STEPS, conversion)


def stated_step(settings: Settings) -> Fraction:
    """Return the step in s that settings state, or the one of a run that states none."""
    words = settings.stated.split()
    return Fraction(words[words.index("--step") + 1]) if "--step" in words else _STEP


def decimal(value: Fraction, digits: int = 2) -> str:
    """Return a number rounded down to few digits, as a C literal in double.

    >>> decimal(Fraction(1, 3)), decimal(Fraction(1, 100), 15), decimal(Fraction(40))
    ('0.33', '0.01', '40.0')
    """
    place = Fraction(10) ** (math.floor(math.log10(value)) - digits + 1)
    return repr(float(math.floor(value / place) * place))
