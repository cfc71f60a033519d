"""Generates the sources of an algorithm in two speeds: its three loops, with formats that match, and their C.

The loops, what passes between them and what is reset are those of the built-in system of the same name. How many cycles
of one loop make one of the next is an argument of the generated functions, so that the rates of the file do not matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from strapgen import pipeline, targets
from strapgen.catalogue import Choice
from strapgen.fixedpoint.format_plan import ranges_of_copies
from strapgen.fixedpoint.sensor_scale import counted
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import DEFAULT_ANGLE, Settings
from strapgen.ir.formats import above
from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Program
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.navigation.systems import built_in, system_file
from strapgen.navigation.systems.fitting import copies, summed, without_needless_feedback
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.navigation.systems.wiring import Description, wired
from strapgen.targets import BUILT_IN, TARGETS
from strapgen.targets.c import real_of
from strapgen.targets.c_numbers import WORDS, types_of
from strapgen.targets.contract import options
from strapgen.targets.rendering import render_c, runs_of

#: Attitude algorithms in two speeds.
ALGORITHMS = {"dcm": "direction cosine matrix", "euler": "Euler parameters, scalar last"}
#: Forms of the sculling integral that the fast loop computes.
SCULLING = {1: "with the rotation compensation in it", 2: "with the rotation compensation in the slow loop"}

#: Factor on stated increments that leaves room for the rounding of sums.
_SPARE = Fraction(33, 32)
#: Smallest increments that formats are chosen for, in rad and m/s.
_LEAST = Fraction(1, 2**16)


def kernels(algorithm: str, sculling: int = 2) -> tuple[str, str, str]:
    """Return the names of the fast, slow and navigation loop.

    >>> kernels("dcm")
    ('two-speed-fast-2', 'dcm-two-speed-slow-2', 'dcm-two-speed-navigation')
    """
    fast, slow, navigation = (stage.kernel for stage in _text(algorithm, sculling).stages)
    return fast, slow, navigation


def description(algorithm: str, sculling: int = 2) -> Description:
    """Return the built-in system with the loops of an algorithm; parameters and errors are those of `kernels`.

    >>> [rate.every for rate in description("dcm").system.rates]
    [1, 64, 320]
    """
    return wired(_text(algorithm, sculling))


def _text(algorithm: str, sculling: int) -> system_file.SystemText:
    """Return the file of the built-in system with the loops of an algorithm."""
    checks.choice("algorithm", algorithm, ALGORITHMS)
    sculling = checks.count("sculling", sculling, largest=len(SCULLING))
    return _read(f"two-speed-{algorithm}" if sculling == 2 else f"two-speed-{algorithm}-{sculling}")


@cache
def _read(name: str) -> system_file.SystemText:
    return system_file.read(built_in.file_of(name))


def ranges(
    angle: float, velocity: float = 0.0, fast_cycles: int = 1, slow_cycles: int = 1
) -> dict[str, Fraction]:
    """Return ranges of the loops' inputs that hold the sums of increments up to a stated size, for fixed point.

    `angle, velocity`: largest magnitude of an element of the angle increments in rad, and of the velocity
    increments in m/s.

    >>> {name: round(float(value), 4) for name, value in ranges(0.01, 0.1, 4).items() if "velocity" not in name}
    {'increment': 0.0103, 'previous_increment': 0.0103, 'angle_sum': 0.0413, 'coning': 0.0009, 'sculling': 0.017}
    """
    turned, moved = (max(Fraction(value), _LEAST) * _SPARE for value in (angle, velocity))
    sums = turned * fast_cycles, moved * fast_cycles
    return {
        "increment": turned,
        "previous_increment": turned,
        "angle_sum": sums[0],
        # The sum of |beta x d|/2 <= |beta| |d| over the cycles, an element; so for sculling.
        "coning": sums[0] ** 2 / 2,
        "velocity_increment": moved,
        "velocity_sum": sums[1],
        "sculling": sums[0] * sums[1],
        # In any direction, turned by at most the angle: each element up to the length.
        "navigation_velocity": 2 * (sums[1] + 2 * sums[0] * sums[1]) * slow_cycles,
    }


def loops(
    algorithm: str, sculling: int = 2, target: str = "c", settings: Settings | None = None
) -> tuple[Sources, Sources, Sources]:
    """Return the generated loops; in fixed point the formats of what passes between them match.

    The increments have the format of their sums, so that no sum is rounded.
    """
    names = kernels(algorithm, sculling)
    targets.require(target, settings)
    if not TARGETS[target].fixed:
        fast, slow, navigation = (pipeline.compile(Choice(name), target) for name in names)
        return fast, slow, navigation
    programs = {name: pipeline.program(Choice(name)) for name in names}
    settings = _in_ranges(settings or Settings(), programs[names[0]])
    inputs = {name: {signal.name for signal in program.inputs} for name, program in programs.items()}
    _require_inputs(settings, set().union(*inputs.values()))
    earlier = {state: name for program in programs.values() for state, name in copies(program).items()}
    ranges = {name: settings.ranges[other] for name, other in earlier.items() if other in settings.ranges}
    wider = ranges_of_copies(programs[names[0]], settings, copies(programs[names[0]]))
    settings = replace(settings, ranges=ranges | wider | dict(settings.ranges))

    def loop(name: str, formats: Mapping[str, str]) -> Sources:
        chosen = settings if counted(programs[name]) else settings.without_counts()
        return without_needless_feedback(
            lambda one: pipeline.compile(Choice(name), target, one),
            _of_inputs(replace(chosen, formats=formats), inputs[name]),
        )

    formats = dict(settings.formats)
    natural = _formats(loop(names[0], formats))
    counts = {s.name for s in counted(programs[names[0]]) if settings.input_bits is not None}
    for total, increment in summed(programs[names[0]]).items():
        if increment in counts:
            continue
        alike = [increment, *(state for state, name in earlier.items() if name == increment)]
        formats |= {name: natural[total] for name in alike if name not in formats}
    result = []
    for name in names:
        result.append(loop(name, formats))
        formats |= {other: text for other, text in _formats(result[-1]).items() if other not in formats}
    fast, slow, navigation = result
    return fast, slow, navigation


def _require_inputs(settings: Settings, known: set[str]) -> None:
    """Check that every range and format is for an input of some loop."""
    for what, stated in (("range", settings.ranges), ("format", settings.formats)):
        for name in sorted(set(stated) - known):
            inputs = ", ".join(sorted(known))
            raise InputError(f"no loop has an input {name!r} for a {what}; inputs are: {inputs}")


def _of_inputs(settings: Settings, inputs: set[str]) -> Settings:
    """Return settings with the ranges and formats of some inputs alone."""
    return replace(
        settings,
        ranges={name: value for name, value in settings.ranges.items() if name in inputs},
        formats={name: text for name, text in settings.formats.items() if name in inputs},
    )


def _formats(sources: Sources) -> dict[str, str]:
    """Return the formats of a loop's inputs; not of counts, whose format follows from their bits."""
    assert sources.fixed is not None
    word = sources.fixed.settings.word
    return {a.signal.name: str(a.format) for a in sources.fixed.inputs if a.format.word == word}


def sources(
    algorithm: str, sculling: int = 2, target: str = "c", settings: Settings | None = None
) -> Sources:
    """Return the C of all loops, with one function for each and one that runs them all.

    >>> list(sources("dcm").files)[:2]
    ['dcm_two_speed_2.h', 'dcm_two_speed_2.c']
    """
    checks.choice("target", target, [name for name, entry in BUILT_IN.items() if entry.compiled])
    if BUILT_IN[target].fixed:
        settings = settings or Settings()
    parts = loops(algorithm, sculling, target, settings)
    title = f"Two speeds: {ALGORITHMS[algorithm]}, sculling {SCULLING[sculling]}"
    system = description(algorithm, sculling).system
    return whole(
        f"{algorithm}-two-speed-{sculling}",
        title,
        command(algorithm, sculling, target, settings),
        system,
        parts,
    )


def command(algorithm: str, sculling: int, target: str, settings: Settings | None) -> str:
    """Return the command line that generates the C of all loops; parameters are those of `loops`."""
    stated = "" if settings is None else f" {options(settings, keep_stated=True)}"
    return f"strapgen two-speed {algorithm} --sculling {sculling} --target {target}{stated}"


def _in_ranges(settings: Settings, fast: Program) -> Settings:
    """Return settings with the largest angle, if one is stated, as the range of the fast loop's increments."""
    if settings.state:
        raise InputError("an algorithm in two speeds takes no state that saturates")
    ranges = dict(settings.ranges)
    for signal in counted(fast) if "--max-" in settings.stated else ():
        if signal.name in ranges:
            raise InputError(
                f"the largest rate and the range of {signal.name} are both stated; one is needed"
            )
        ranges[signal.name] = settings.largest_angle
    return replace(settings, ranges=ranges, largest_angle=DEFAULT_ANGLE, stated="")


#: Names of the loops, from the fastest.
LOOPS = ("fast", "slow", "navigation")
#: The kernel that removes rounding from an attitude, by the size of its state.
_NORMALIZATION = {9: "dcm-orthonormalize-first-order", 4: "euler-normalize-first-order"}


@dataclass(frozen=True)
class Wiring:
    """The sources and destinations of the loops' arguments."""

    #: Values that pass from call to call of a loop, or from loop to loop
    memory: tuple[Signal, ...]
    #: The other inputs of each loop
    samples: tuple[tuple[Signal, ...], ...]
    #: The other outputs of each loop
    results: tuple[tuple[Signal, ...], ...]
    #: The value of the memory that an output replaces, by the name of the output, for each loop
    updates: tuple[Mapping[str, str], ...]
    #: Values of the memory that are zero again after a cycle of each loop
    cleared: tuple[tuple[str, ...], ...]

    def memory_named(self, name: str) -> Signal:
        """Return a signal of the memory by its name."""
        return next(signal for signal in self.memory if signal.name == name)


def wiring(system: DescribedSystem, loops: Sequence[Sources]) -> Wiring:
    """Return how the arguments of loops are connected."""
    memory: dict[str, Signal] = {}
    samples = []
    for stage, loop in zip(system.stages, loops, strict=True):
        wired = [*zip(stage.wires, loop.function.inputs, strict=True)]
        memory |= {wire.source: signal for wire, signal in wired if not wire.external}
        samples.append(tuple(signal for wire, signal in wired if wire.external))
    updates = tuple(
        {output: memory[cell].name for output, cell in stage.results if cell in memory}
        for stage in system.stages
    )
    return Wiring(
        tuple(memory.values()),
        tuple(samples),
        tuple(
            tuple(signal for signal in loop.function.outputs if signal.name not in replaced)
            for loop, replaced in zip(loops, updates, strict=True)
        ),
        updates,
        tuple(
            tuple(signal.name for cell, signal in memory.items() if cell in rate.cleared)
            for rate in system.rates
        ),
    )


def whole(name: str, title: str, command: str, system: DescribedSystem, loops: Sequence[Sources]) -> Sources:
    """Generate the C of all loops: one function for a cycle of each, and one that runs whole navigation cycles."""
    fast, slow, _ = loops
    numbers, wires = _numbers(fast), wiring(system, loops)
    state = wires.memory_named(slow.function.inputs[0].name)
    identifier = name.replace("-", "_") + numbers.suffix
    outputs = (state, *wires.results[2])
    types = {name: kind for loop in loops for name, kind in types_of(loop).items()}
    values = {
        "title": title,
        "command": command,
        "version": VERSION,
        "guard": f"{identifier}_h".upper(),
        "headers": [next(file for file in loop.files if file.endswith(".h")) for loop in loops],
        "loops": LOOPS,
        "costs": [_cost(which, loop) for which, loop in zip(LOOPS, loops, strict=True)],
        "normalization": _NORMALIZATION[state.size],
        "types": types,
        "residual_type": numbers.feedback_type,
        "word": numbers.word,
        "memory": wires.memory,
        "state": state,
        "samples": wires.samples,
        "results": wires.results[2],
        **_contracts(loops),
        **_cycles(loops, wires, types, identifier),
        **_run(wires, types, outputs),
    }
    files = render_c("two_speed_c", identifier, **values)
    for loop in loops:
        files |= loop.step_files
    counts = {kind: sum(loop.operations[kind] for loop in loops) for kind in fast.operations}
    temporaries = sum(loop.temporaries for loop in loops)
    function = Function(identifier, sum(wires.samples, ()), outputs)
    info = KernelInfo(name, title, "")
    return Sources(info, fast.target, files, function, counts, temporaries, runs=runs_of(identifier))


def _cost(which: str, loop: Sources) -> str:
    """Return the operations of a loop and the error bounds of a call, in words."""
    errors = ", ".join(f"{name} {above(error, 4)}" for name, error in loop.largest_errors.items())
    bound = f"error of a call at most: {errors}" if errors else "no error bound is known"
    return f"_{which}: {loop.cost}; {bound}"


class _Numbers(NamedTuple):
    """The numbers of the loops in C: ending of names, type of error feedback, bits of a word."""

    suffix: str
    feedback_type: str = ""
    word: int = 0


def _numbers(loop: Sources) -> _Numbers:
    """Return the numbers of a loop; a word of 0 bits stands for floating point."""
    if loop.fixed is None:
        real = real_of(loop.target)
        return _Numbers(real.infix)
    word = WORDS[loop.fixed.settings.word]
    return _Numbers(f"_w{word.bits}", word.residual, word.bits)


def _contracts(loops: Sequence[Sources]) -> dict[str, object]:
    """Return the contract of fixed point for the header: arguments by name, and the error feedback of each loop."""
    interfaces = {which: loop.fixed for which, loop in zip(LOOPS, loops, strict=True) if loop.fixed}
    arguments: dict[str, Argument] = {}
    for interface in interfaces.values():
        arguments |= {a.signal.name: a for a in (*interface.inputs, *interface.outputs)}
    feedback = {which: interface.residuals for which, interface in interfaces.items() if interface.residuals}
    return {"arguments": arguments, "residuals": feedback}


def _cycles(
    loops: Sequence[Sources], wires: Wiring, types: Mapping[str, str], identifier: str
) -> dict[str, object]:
    """Return the text of the function of one cycle, for each loop by name."""
    names, parameters = {}, {}
    for which, samples, results in zip(LOOPS, wires.samples, wires.results, strict=True):
        names[which] = ["memory", *(signal.name for signal in (*samples, *results))]
        pointers = [f"const {types[s.name]} *{s.name}" for s in samples]
        pointers += [f"{types[s.name]} *{s.name}" for s in results]
        parameters[which] = ", ".join([f"{identifier}_memory *memory", *pointers])
    return {
        "parameters": parameters,
        "checked": names,
        "given": {which: ", ".join(arguments) for which, arguments in names.items()},
        "calls": {
            which: f"{loop.function.name}({_call(loop, which, wires)})"
            for which, loop in zip(LOOPS, loops, strict=True)
        },
        "clears": dict(zip(LOOPS, wires.cleared, strict=True)),
    }


def _run(wires: Wiring, types: Mapping[str, str], outputs: Sequence[Signal]) -> dict[str, object]:
    """Return the text of the function that runs whole navigation cycles: its arrays, and the pointers to check."""
    samples = sum(wires.samples, ())
    arrays = [f", const {types[s.name]} *{s.name}" for s in samples]
    arrays += [f", {types[s.name]} *{s.name}" for s in outputs]
    return {"arrays": "".join(arrays), "pointers": ["memory", *(s.name for s in (*samples, *outputs))]}


def _call(loop: Sources, which: str, wires: Wiring) -> str:
    """Return the arguments of a loop's function."""
    memory = {signal.name for signal in wires.memory}

    def place(name: str) -> str:
        return f"memory->{name}" if name in memory else name

    inputs = [place(signal.name) for signal in loop.function.inputs]
    if loop.fixed is not None and loop.fixed.residuals:
        inputs.append(f"memory->residuals_{which}")
    updates = wires.updates[LOOPS.index(which)]
    outputs = [place(updates.get(signal.name, signal.name)) for signal in loop.function.outputs]
    return ", ".join([*inputs, *outputs])
