"""What a unit for co-simulation stores and calls: of a step or another kernel, of two speeds, and of a system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.firmware.fmu.variables import Variable, Variables, types
from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.fitting import GeneratedStages
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.run.kernel_sources import StepSources
from strapgen.targets.c import real_of
from strapgen.targets.c_numbers import memory_type, numbers_of

#: The length of a step in s that a unit begins with where none is stated.
WIDTH = Fraction(1, 100)
#: Fast cycles in a slow cycle and slow cycles in a navigation cycle that a unit of two speeds begins with.
CYCLES = (4, 2)


@dataclass(frozen=True, eq=False)
class Unit:
    """What a unit stores and calls."""

    #: Template of what begins and steps it
    kind: str
    name: str
    title: str
    command: str
    #: What a communication step is
    period: str
    #: Length of a step in s; None where a parameter has it
    step: Fraction | None
    variables: Sequence[Variable]
    #: Generated C by name
    files: Mapping[str, str]
    #: Members of the struct beside the variables
    memory: Sequence[str]
    #: Values for the template
    values: Mapping[str, Any]


def stated_step(settings: Settings | None, samples: int) -> Fraction | None:
    """Return the length in s of a step of so many samples that settings state, or None.

    >>> stated_step(Settings.of(max_rate_deg_s=400, sample_hz=200), 2), stated_step(None, 2)
    (Fraction(1, 100), None)
    """
    words = [] if settings is None else settings.stated.split()
    if "--step" in words:
        return Fraction(words[words.index("--step") + 1])
    if "--sample-hz" in words:
        return samples / checks.number("sample_hz", words[words.index("--sample-hz") + 1])
    return None


def of_kernel(choice: Choice, sources: Sources, settings: Settings | None, command: str) -> Unit:
    """Return the unit of a step, or of another kernel: each communication step is a call."""
    step, function, name = sources.attitude_step, sources.function, sources.function.name
    first, last = function.inputs[0], function.inputs[-1]
    states = {} if sources.recursion is None else dict(sources.recursion.states)
    states |= {} if step is None else {first.name: function.outputs[0].name}
    samples = 1 if step is None else choice.increments_per_step
    width = stated_step(settings, samples)
    variables = Variables(types(sources), width, float(WIDTH))
    window: dict[str, int] = {}
    for signal in function.inputs:
        if signal.name in states:
            identity = step.identity if step is not None and signal == first else signal.identity
            variables.add("parameter", signal, identity or (), name=f"initial_{signal.name}")
        elif step is not None and step.extra_increments and signal == last:
            window = _add_window(variables, signal, samples, step.previous, step.ahead)
        else:
            variables.add("input", signal)
    for signal in (*(s for s in function.inputs if s.name in states), *function.outputs):
        if signal.name not in states.values():
            variables.add("output", signal)
    attitude: dict[str, Any] = {}
    files = dict(sources.step_files)
    if step is not None and step.attitude is not None:
        conversion = StepSources(sources, choice).sources(step.attitude, "c")
        attitude = _add_attitude(variables, first, conversion)
        files |= conversion.step_files
    numbers, feedback = numbers_of(sources), () if sources.fixed is None else sources.fixed.residuals
    memory = [f"{numbers.feedback_type} residuals[{len(feedback)}];"] if feedback else []
    if window:
        memory += [f"{variables.types[last.name][0]} window[{3 * window['size']}];", "uint32_t steps;"]
    places = {output: state for state, output in states.items()} | ({last.name: "window"} if window else {})
    by_value = {s.name for s in function.inputs if not s.shape and sources.fixed is None}
    values = {
        "function": name,
        "call": [
            *(f"data->{places.get(s.name, s.name)}{'[0]' * (s.name in by_value)}" for s in function.inputs),
            *(["data->residuals"] if feedback else []),
            *(f"data->{places.get(s.name, s.name)}" for s in function.outputs),
        ],
        "states": [*states],
        "window": window,
        "fresh_type": numbers.feedback_type,
        "fresh": [f"{word.fresh}u" for word in feedback],
        "attitude": attitude,
        "fixed": sources.fixed is not None,
    }
    return Unit("step", name, sources.info.title, command, "call", width, variables, files, memory, values)


def _add_window(
    variables: Variables, signal: Signal, samples: int, previous: int, ahead: int
) -> dict[str, int]:
    """Add the samples of a step alone as an input, and those before the first step as a parameter.

    Returns what is kept for a step that takes others beside its own.
    """
    late = -(-ahead // samples)
    if previous:
        meaning = f"samples before the first step; {signal.meaning}"
        before = replace(
            signal, shape=(previous, 3), elements=signal.elements[: 3 * previous], meaning=meaning
        )
        variables.add("parameter", before, name="previous_increments")
    own = slice(3 * previous, 3 * (previous + samples))
    meaning = f"samples of the step alone; {signal.meaning}"
    variables.add(
        "input", replace(signal, shape=(samples, 3), elements=signal.elements[own], meaning=meaning)
    )
    return {
        "samples": samples,
        "previous": previous,
        "late": late,
        "size": previous + samples * (late + 1),
    }


def _add_attitude(variables: Variables, state: Signal, conversion: Sources) -> dict[str, Any]:
    """Add the matrix of a state as an output; return what computes it in double."""
    (result,) = conversion.function.outputs
    variables.types = {**variables.types, "attitude": ("double", None)}
    variables.add("output", replace(result, name="attitude"))
    argument = variables.types[state.name][1]
    fraction = 0 if argument is None else argument.format.fraction
    function = conversion.function.name
    return {"function": function, "state": state.name, "size": state.size, "fraction": fraction}


def of_two_speeds(
    algorithm: str, sculling: int, target: str, settings: Settings | None, command: str
) -> Unit:
    """Return the unit of an algorithm in two speeds: each communication step is a fast cycle."""
    whole = two_speed_sources.sources(algorithm, sculling, target, settings)
    loops = two_speed_sources.loops(algorithm, sculling, target, settings)
    system = two_speed_sources.description(algorithm, sculling).system
    wires = two_speed_sources.wiring(system, loops)
    name, state, change = whole.function.name, loops[1].function.inputs[0], wires.results[2][0]
    width = stated_step(settings, 1)
    variables = Variables(types(*loops), width, float(WIDTH))
    variables.own("fast_cycles", "int32_t", CYCLES[0], "fast cycles in a slow cycle")
    variables.own("slow_cycles", "int32_t", CYCLES[1], "slow cycles in a navigation cycle")
    variables.add("parameter", state, state.identity or (), name=f"initial_{state.name}")
    for cell in ("previous_increment", "previous_turn"):
        variables.add("parameter", wires.memory_named(cell))
    for signal in sum(wires.samples, ()):
        variables.add("input", signal)
    for signal in (state, change):
        variables.add("output", signal)
    attitude: dict[str, Any] = {}
    files = dict(whole.step_files)
    if algorithm != "dcm":
        conversion = pipeline.compile(Choice(f"dcm-from-{algorithm}"), "c")
        attitude = _add_attitude(variables, state, conversion)
        files |= conversion.step_files
    values = {
        "function": name,
        "state": state.name,
        "change": change.name,
        "calls": [
            f"{name}_{loop}({', '.join(['&data->memory', *(f'data->{s.name}' for s in (*samples, *results))])})"
            for loop, samples, results in zip(
                two_speed_sources.LOOPS, wires.samples, wires.results, strict=True
            )
        ],
        "attitude": attitude,
        "fixed": loops[0].fixed is not None,
    }
    memory = [f"{name}_memory memory;", "int32_t fast;", "int32_t slow;"]
    title = whole.info.title
    return Unit("two_speed", name, title, command, "fast cycle", width, variables, files, memory, values)


def of_system(fit: GeneratedStages, sources: Sources, command: str) -> Unit:
    """Return the unit of a described system: each communication step is a cycle of the fastest rate."""
    system, name = fit.description.system, sources.function.name
    signals = {s.name: s for s in system.inputs} | {
        cell.name: replace(cell.signal, name=cell.name) for cell in system.cells
    }
    number = "" if fit.arguments else real_of(fit.target).name
    formats = {name: fit.arguments.get(name) for name in signals}
    variables = Variables(
        {name: (number if held is None else memory_type(held), held) for name, held in formats.items()},
        1 / system.sample_hz,
        0.0,
    )
    written = [(stage, {cell for _, cell in stage.results}) for stage in system.stages]
    own = {wire.source for stage, cells in written for wire in stage.wires if wire.source in cells}
    states = [cell for cell in system.outputs if cell in own]
    for cell in states:
        variables.add("parameter", signals[cell], system.cell(cell).initial, name=f"initial_{cell}")
    for signal in system.inputs:
        variables.add("input", signal)
    for cell in system.outputs:
        variables.add("output", signals[cell])
    values = {
        "function": name,
        "cells": system.outputs,
        "states": states,
        "stages": [stage.name for stage in system.stages],
        "inputs": [signal.name for signal in system.inputs],
        "fixed": bool(fit.arguments),
    }
    period, memory = "cycle of the fastest rate", [f"{name}_memory memory;"]
    width, files = 1 / system.sample_hz, sources.step_files
    return Unit("system", name, system.title, command, period, width, variables, files, memory, values)
