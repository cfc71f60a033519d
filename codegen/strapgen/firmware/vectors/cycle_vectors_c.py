"""Prints a run of an algorithm in two speeds as test vectors: samples, and the attitudes and velocities that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.firmware.vectors.vectors_c import file_names
from strapgen.ir.sources import Sources
from strapgen.navigation.two_speed.two_speed_sources import LOOPS, Wiring
from strapgen.targets.c.number_text import NumberText, numbers_of, types_of
from strapgen.targets.lines import fill_arguments
from strapgen.targets.rendering import render

Rows = Sequence[Sequence[Any]]


@dataclass(frozen=True)
class CycleTable:
    """A run of whole navigation cycles from zero rotation."""

    #: All loops in C
    whole: Sources
    #: The fast, slow and navigation loop in C
    loops: tuple[Sources, ...]
    wires: Wiring
    #: The command that generates the run
    command: str
    #: Fast cycles in a slow cycle, slow cycles in a navigation cycle, and navigation cycles
    fast: int
    slow: int
    navigation: int
    #: The attitude at the start
    initial: Sequence[Any]
    #: The samples of every cycle, by the names of the loops' inputs
    samples: Mapping[str, Rows]
    #: The attitude after every slow cycle, and after the navigation cycle that ends with it
    attitudes: Rows
    #: The change of velocity over every navigation cycle
    changes: Rows
    #: A sample of the fast loop that it must refuse; empty in floating point
    refused: Sequence[Any]


def cycle_files(table: CycleTable) -> dict[str, str]:
    """Print the run as test vectors."""
    name, numbers, wires = table.whole.function.name, numbers_of(table.loops[0]), table.wires
    state = wires.memory_named(table.loops[1].function.inputs[0].name)
    (change,) = wires.results[2]
    expected = {state.name: table.attitudes, change.name: table.changes}
    sizes = {signal.name: signal.size for signal in (state, *sum(wires.samples, ()), change)}
    values = {
        "name": name,
        "macro": name.upper(),
        "command": table.command,
        "numbers": numbers,
        "types": {name: kind for loop in table.loops for name, kind in types_of(loop).items()},
        "table": table,
        "state": state,
        "change": change,
        "samples": wires.samples,
        "calls": loop_calls(name, wires),
        "refused": [numbers.literal(value) for value in table.refused],
        "initial": [numbers.literal(value) for value in table.initial],
        "arrays": [
            (field, sizes[field], _rows(rows, numbers))
            for field, rows in {**table.samples, **expected}.items()
        ],
    }
    header, test, _ = file_names(name)
    return {
        header: render("vectors_c/cycles.h.j2", **values),
        test: render("vectors_c/cycles_test.c.j2", **values),
    }


def loop_calls(name: str, wires: Wiring) -> dict[str, str]:
    """Return a call of the function of each loop."""
    return {
        loop: f"{name}_{loop}({', '.join(['&memory', *(s.name for s in (*samples, *results))])})"
        for loop, samples, results in zip(LOOPS, wires.samples, wires.results, strict=True)
    }


def _rows(rows: Rows, numbers: NumberText) -> list[str]:
    return [
        fill_arguments(f"{{{', '.join(numbers.literal(value) for value in row)}}},", "     ", 94)
        for row in rows
    ]
