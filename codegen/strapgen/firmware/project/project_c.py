"""Prints what builds and runs generated C: a CMake project, and a main program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from strapgen.firmware.vectors.cycle_vectors_c import loop_calls
from strapgen.firmware.vectors.vectors_c import VectorTable
from strapgen.ir.interfaces import Argument
from strapgen.ir.sources import Sources
from strapgen.navigation.two_speed.two_speed_sources import Wiring
from strapgen.targets.c.number_text import numbers_of, types_of
from strapgen.targets.registry import BUILT_IN
from strapgen.targets.rendering import render

#: Folder of a project with the functions in double that the main program compares with.
MOTION = "motion"


@dataclass(frozen=True)
class MotionRun:
    """The run of a main program on coning: the rate is ``rate (sin(rate t), 1, cos(rate t))`` in rad/s."""

    #: In rad/s, and the step in s, as decimals
    rate: str
    step: str
    steps: int
    #: The function in double that converts a state to a direction cosine matrix; "" where the state is one
    conversion: str = ""
    #: In two speeds: fast cycles in a slow cycle, slow cycles in a navigation cycle. A step is then a slow
    #: cycle, and `steps` counts navigation cycles
    fast: int = 1
    slow: int = 1


def cmake(sources: Sources, command: str, motion: Sequence[str], tests: Sequence[str]) -> str:
    """Return the text of CMakeLists.txt."""
    name, files = sources.function.name, sources.step_files
    return render(
        "project_c/CMakeLists.txt.j2",
        title=f"Builds {name} as a library, and a run and tests of it.",
        name=name,
        package=f"strapgen_{name}",
        command=command,
        code=[file for file in files if file.endswith(".c")],
        floating=bool(BUILT_IN[sources.target].number),
        headers=[file for file in files if file.endswith(".h")],
        motion=motion,
        tests=tests,
    )


def step_main(sources: Sources, command: str, run: MotionRun) -> str:
    """Return a main program that runs an attitude step on coning and prints the attitude and its error."""
    assert sources.attitude_step is not None
    beside = sources.attitude_step
    return render(
        "project_c/main_step.c.j2",
        samples=sources.function.inputs[-1].size // 3 - beside.beside,
        previous=beside.previous,
        ahead=beside.ahead,
        **_values(sources, command, run, sources.attitude_step.identity),
        **_formats(sources),
    )


def _formats(sources: Sources) -> dict[str, Any]:
    """Return the fraction bits of the state and the format of the increments; nothing in floating point."""
    if sources.fixed is None:
        return {"state_fraction": 0, "increments": None, "increments_unit": ""}
    state, increments = sources.fixed.inputs
    return {
        "state_fraction": state.format.fraction,
        "increments": increments,
        "increments_unit": repr(float(increments.unit)),
    }


def _values(sources: Sources, command: str, run: MotionRun, identity: Sequence[Fraction]) -> dict[str, Any]:
    """Return what the main programs of a step and of an algorithm in two speeds have in common."""
    numbers = numbers_of(sources)
    kernels = ["coning_increments", "coning_truth", *([run.conversion] if run.conversion else [])]
    feedback = () if sources.fixed is None else sources.fixed.residuals
    start: Sequence[Any] = identity
    if sources.fixed is not None:
        start = [sources.fixed.inputs[0].format.nearest(element) for element in identity]
    return {
        "name": sources.function.name,
        "command": command,
        "motion": kernels,
        "rate": run.rate,
        "seconds": run.step,
        "steps": run.steps,
        "conversion": run.conversion,
        "state": sources.function.inputs[0],
        "identity": [numbers.literal(element) for element in start],
        "type": numbers.type,
        "types": types_of(sources),
        "word": numbers.word,
        "feedback_type": numbers.feedback_type,
        "feedback": [f"{word.fresh}u" for word in feedback],
    }


def two_speed_main(
    whole: Sources, loops: Sequence[Sources], wires: Wiring, command: str, run: MotionRun
) -> str:
    """Return a main program that runs an algorithm in two speeds on coning and prints the attitude and its error."""
    fast, slow, navigation = loops
    state = slow.function.inputs[0]
    identity = [Fraction(place % 4 == 0 if state.size == 9 else place == 3) for place in range(state.size)]
    increment, *others = sum(wires.samples, ())
    formats = {a.signal.name: a for loop in (fast, slow) for a in _inputs(loop)}
    values = {
        "name": whole.function.name,
        "fast": run.fast,
        "slow": run.slow,
        "samples": [increment],
        "zeros": others,
        "change": wires.results[2][0],
        "calls": loop_calls(whole.function.name, wires),
        "formats": formats,
        "types": types_of(fast) | types_of(slow) | types_of(navigation),
        "unit": repr(float(formats[increment.name].unit)) if formats else "",
        "state_fraction": formats[state.name].format.fraction if formats else 0,
    }
    return render("project_c/main_two_speed.c.j2", **_values(slow, command, run, identity) | values)


def _inputs(loop: Sources) -> tuple[Argument, ...]:
    return () if loop.fixed is None else loop.fixed.inputs


def call_main(table: VectorTable, command: str) -> str:
    """Return a main program that calls a function once, on the last of its vectors that is accepted."""
    sources, numbers = table.sources, numbers_of(table.sources)
    vector = next(row for row in reversed(table.rows) if row.status == 0)
    inputs = [
        (f"in_{signal.name}", signal, [numbers.literal(value) for value in values])
        for signal, values in zip(sources.function.inputs, vector.inputs, strict=True)
    ]
    fixed: Mapping[str, Argument] = {}
    if sources.fixed is not None:
        fixed = {argument.signal.name: argument for argument in sources.fixed.outputs}
    outputs = [
        (f"out_{s.name}", s, fixed[s.name].format.fraction if fixed else 0) for s in sources.function.outputs
    ]
    call = [name + ("" if signal.shape or numbers.word else "[0]") for name, signal, _ in inputs]
    feedback = [f"{word}u" for word in vector.feedback]
    return render(
        "project_c/main_call.c.j2",
        name=sources.function.name,
        command=command,
        numbers=numbers,
        types=types_of(sources),
        inputs=inputs,
        outputs=outputs,
        feedback=feedback,
        call=", ".join([*call, *(["feedback"] if feedback else []), *(name for name, _, _ in outputs)]),
    )
