"""Prints C for an algorithm in two speeds: the functions of its three loops, and one that runs them in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from strapgen.ir.formats import above
from strapgen.ir.interfaces import Argument
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Function, Sources
from strapgen.ir.version import VERSION
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.targets.c import real_of
from strapgen.targets.c_numbers import WORDS, types_of
from strapgen.targets.rendering import render_c, runs_of

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
    """Return the operations of a loop and what a call of it may be off, in words."""
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
    """Return what the header says about fixed point: arguments by name, and the error feedback of each loop."""
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
