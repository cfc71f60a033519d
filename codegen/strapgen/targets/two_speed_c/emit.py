"""Three loops in one C function: fast, slow and navigation cycles around what each loop hands on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.ir.fixed_interface import Argument
from strapgen.ir.recursion import Recursion
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Function, Sources
from strapgen.targets.c.emit import REALS
from strapgen.targets.c_fixed.emit import WORDS
from strapgen.targets.rendering import render

#: What the loops are called, from the fastest.
LOOPS = ("fast", "slow", "navigation")
#: What takes rounding out of an attitude, by the size of its state.
_NORMALIZATION = {9: "dcm-orthonormalize-first-order", 4: "euler-normalize-first-order"}


@dataclass(frozen=True)
class Wiring:
    """Where the arguments of loops come from and go to.

    Parameters
    ----------
    memory : tuple of Signal
        What is handed on, within a loop or from loop to loop.
    samples : tuple of tuple of Signal
        What each loop is given from outside.
    results : tuple of tuple of Signal
        What each loop gives back beside what is handed on.
    """

    memory: tuple[Signal, ...]
    samples: tuple[tuple[Signal, ...], ...]
    results: tuple[tuple[Signal, ...], ...]

    def memory_named(self, name: str) -> Signal:
        """Return what is handed on by its name."""
        return next(signal for signal in self.memory if signal.name == name)


def recursion(sources: Sources) -> Recursion:
    """Return the recursion of a loop."""
    assert sources.recursion is not None, "a loop tells what it hands on"
    return sources.recursion


def wiring(loops: Sequence[Sources]) -> Wiring:
    """Return where the arguments of loops come from and go to: what has one name is one quantity."""
    held = {name for loop in loops for name, _ in recursion(loop).states}
    memory = {signal.name: signal for loop in loops for signal in loop.function.inputs if signal.name in held}
    return Wiring(
        tuple(memory.values()),
        tuple(tuple(s for s in loop.function.inputs if s.name not in held) for loop in loops),
        tuple(
            tuple(s for s in loop.function.outputs if s.name not in recursion(loop).inputs) for loop in loops
        ),
    )


def whole(name: str, title: str, command: str, loops: Sequence[Sources]) -> Sources:
    """Generate the function that runs all loops.

    Parameters
    ----------
    name : str
        Name of the algorithm on the command line.
    title : str
        One line that says what it computes.
    command : str
        What generates it.
    loops : sequence of Sources
        The C of the fast, slow and navigation loop; in fixed point in formats that fit together.

    Returns
    -------
    Sources
        The function with its memory, and the files of the loops.
    """
    fast, slow, _ = loops
    fixed = fast.fixed
    wires = wiring(loops)
    state = wires.memory_named(slow.function.inputs[0].name)
    real = None if fixed else REALS[fast.target]
    if fixed is not None:
        suffix, type_ = f"_q{fixed.settings.word - 1}", WORDS[fixed.settings.word].type
        residual_type = WORDS[fixed.settings.word].residual
    else:
        assert real is not None
        suffix, type_, residual_type = real.infix, real.name, ""
    identifier = name.replace("-", "_") + suffix
    arguments: dict[str, Argument] = {}
    for loop in loops:
        if loop.fixed is not None:
            arguments |= {a.signal.name: a for a in (*loop.fixed.inputs, *loop.fixed.outputs)}
    residuals = {
        which: loop.fixed.residuals
        for which, loop in zip(LOOPS, loops, strict=True)
        if loop.fixed is not None
    }
    own_names = {
        which: [s.name for s in (*taken, *given)]
        for which, taken, given in zip(LOOPS, wires.samples, wires.results, strict=True)
    }
    own_parameters = {
        which: [*(f"const {type_} *{s.name}" for s in taken), *(f"{type_} *{s.name}" for s in given)]
        for which, taken, given in zip(LOOPS, wires.samples, wires.results, strict=True)
    }
    values = {
        "name": identifier,
        "title": title,
        "command": command,
        "guard": f"{identifier}_h".upper(),
        "headers": [next(file for file in loop.files if file.endswith(".h")) for loop in loops],
        "loops": LOOPS,
        "normalization": _NORMALIZATION[state.size],
        "type": type_,
        "residual_type": residual_type,
        "word": fixed.settings.word if fixed else 0,
        "memory": wires.memory,
        "state": state,
        "samples": wires.samples,
        "results": wires.results[2],
        "arguments": arguments,
        "residuals": {which: kept for which, kept in residuals.items() if kept},
        "calls": {
            which: f"{loop.function.name}({_call(loop, which, wires)})"
            for which, loop in zip(LOOPS, loops, strict=True)
        },
        # What a loop has summed begins anew when the next slower one has taken it.
        "clears": dict(zip(LOOPS, [(), *(recursion(loop).begun_anew for loop in loops[:-1])], strict=True)),
        "parameters": {
            which: ", ".join([f"{identifier}_memory *memory", *own]) for which, own in own_parameters.items()
        },
        "checked": {which: ["memory", *names] for which, names in own_names.items()},
        "given": {which: ", ".join(["memory", *names]) for which, names in own_names.items()},
        "arrays": "".join(
            [f", const {type_} *{s.name}" for group in wires.samples for s in group]
            + [f", {type_} *{s.name}" for s in (state, *wires.results[2])]
        ),
        "pointers": [
            "memory",
            *(s.name for group in wires.samples for s in group),
            *(s.name for s in (state, *wires.results[2])),
        ],
    }
    files = {
        f"{identifier}.h": render("two_speed_c/header.h.j2", **values),
        f"{identifier}.c": render("two_speed_c/source.c.j2", **values),
    }
    for loop in loops:
        files |= loop.files
    counts = dict.fromkeys(fast.operations, 0)
    for loop in loops:
        counts = {kind: counts[kind] + loop.operations[kind] for kind in counts}
    function = Function(identifier, sum(wires.samples, ()), (state, *wires.results[2]))
    temporaries = sum(loop.temporaries for loop in loops)
    return Sources(name, fast.target, files, function, counts, temporaries, None)


def _call(loop: Sources, which: str, wires: Wiring) -> str:
    """Return the arguments of a loop's function."""
    memory = {signal.name for signal in wires.memory}

    def place(name: str) -> str:
        return f"memory->{name}" if name in memory else name

    inputs = [place(signal.name) for signal in loop.function.inputs]
    if loop.fixed is not None and loop.fixed.residuals:
        inputs.append(f"memory->residuals_{which}")
    outputs = [
        place(recursion(loop).inputs.get(signal.name, signal.name)) for signal in loop.function.outputs
    ]
    return ", ".join([*inputs, *outputs])
