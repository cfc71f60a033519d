"""Prints test vectors of generated C: calls of a function, or a run of an algorithm in two speeds.

A header has the table, a file of CSV has it too, and a test in C99 prints how many vectors passed and how many failed.
It needs `printf` alone, and runs on any processor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.ir.sources import Sources
from strapgen.navigation.two_speed.two_speed_sources import LOOPS, Wiring
from strapgen.targets.c_numbers import NumberText, numbers_of, types_of
from strapgen.targets.printer import fill_arguments
from strapgen.targets.rendering import render


@dataclass(frozen=True)
class CallVector:
    """A call of a function: inputs and expected outputs."""

    #: The elements of every input: integers in fixed point, floating-point numbers otherwise
    inputs: tuple[tuple[Any, ...], ...]
    #: Words of error feedback before the call
    feedback: tuple[int, ...]
    #: Error code; 0 where the call is accepted
    status: int
    #: The elements of every output; zeros where the call is refused and leaves its outputs alone
    outputs: tuple[tuple[Any, ...], ...]
    #: Words of error feedback after the call
    next_feedback: tuple[int, ...]


@dataclass(frozen=True)
class VectorTable:
    """Test vectors of a function."""

    #: The function in C
    sources: Sources
    #: The command that generates the vectors
    command: str
    rows: tuple[CallVector, ...]
    #: Largest difference of an element that is allowed, for each output: 0 where all bits must agree
    tolerances: tuple[float, ...]


def file_names(name: str) -> tuple[str, str, str]:
    """Return the names of the header, the test and the CSV of a function's vectors."""
    return f"{name}_vectors.h", f"test_{name}.c", f"{name}_vectors.csv"


def table_files(table: VectorTable) -> dict[str, str]:
    """Print test vectors."""
    sources, numbers = table.sources, numbers_of(table.sources)
    name = sources.function.name
    feedback = () if sources.fixed is None else sources.fixed.residuals
    inputs = [f"in_{signal.name}" for signal in sources.function.inputs]
    call = [
        f"vector.{field}" + ("" if signal.shape or numbers.word else "[0]")
        for field, signal in zip(inputs, sources.function.inputs, strict=True)
    ]
    outputs = [f"out_{signal.name}" for signal in sources.function.outputs]
    values = {
        "name": name,
        "macro": name.upper(),
        "command": table.command,
        "types": types_of(sources),
        "numbers": numbers,
        "inputs": list(zip(inputs, sources.function.inputs, strict=True)),
        "outputs": list(zip(outputs, sources.function.outputs, table.tolerances, strict=True)),
        "feedback": feedback,
        "count": len(table.rows),
        "refused": sum(row.status != 0 for row in table.rows),
        "tolerant": any(table.tolerances),
        "call": ", ".join([*call, *(["feedback"] if feedback else []), *outputs]),
        "rows": [_row(row, numbers) for row in table.rows],
        "heads": _heads(sources),
        "lines": [_line(row, numbers) for row in table.rows],
    }
    templates = ("vectors.h", "test.c", "vectors.csv")
    return {
        file: render(f"vectors_c/{template}.j2", **values)
        for file, template in zip(file_names(name), templates, strict=True)
    }


def _row(row: CallVector, numbers: NumberText) -> str:
    """Return a vector as the initializer of its struct."""
    words = [f"{value}u" for value in row.feedback], [f"{value}u" for value in row.next_feedback]
    groups = [[numbers.literal(value) for value in group] for group in row.inputs]
    groups += [words[0]] if words[0] else []
    results = [[numbers.literal(value) for value in group] for group in row.outputs]
    results += [words[1]] if words[1] else []
    status = [str(row.status)] if numbers.word else []
    parts = [_braces(group) for group in groups] + status + [_braces(group) for group in results]
    lines = [fill_arguments(f"{part},", "      ", 94) for part in parts]
    return "{" + "\n     ".join(lines).removesuffix(",") + "},"


def _braces(parts: Sequence[str]) -> str:
    return f"{{{', '.join(parts)}}}"


def _heads(sources: Sources) -> list[str]:
    """Return the names of the columns."""
    feedback = [] if sources.fixed is None else [word.name for word in sources.fixed.residuals]
    heads = [element for signal in sources.function.inputs for element in signal.elements]
    heads += [f"before_{name}" for name in feedback] + ([] if sources.fixed is None else ["status"])
    heads += [element for signal in sources.function.outputs for element in signal.elements]
    return heads + [f"after_{name}" for name in feedback]


def _line(row: CallVector, numbers: NumberText) -> list[str]:
    """Return the columns of a vector; a refused call has no outputs."""
    cells = [numbers.text(value) for group in row.inputs for value in group] + list(map(str, row.feedback))
    cells += [str(row.status)] if numbers.word else []
    cells += ["" if row.status else numbers.text(value) for group in row.outputs for value in group]
    return cells + list(map(str, row.next_feedback))


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
