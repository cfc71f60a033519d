"""What a step costs on microcontrollers, beside one written by hand; prints the tables of docs/microcontrollers.md.

The counts come from `strapgen.lab.cost`, as those of ``strapgen cost``; they are the same on any machine
with the compilers that the page names.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np

from strapgen import catalogue, pipeline
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.lab import cost
from strapgen.lab.cost import Cost
from strapgen.lab.processors import PROCESSORS

HERE = Path(__file__).resolve().parent / "fixed_point"
BY_HAND = "by hand"
#: The steps written by hand, and their sources; the second is in no table of all processors.
HAND_WRITTEN = {BY_HAND: "by_hand.c", "tuned by hand": "tuned_by_hand.c"}
#: Columns of the tables: the target of each, and its word.
COLUMNS = {
    "32 bits": ("c-fixed", 32),
    BY_HAND: ("c-fixed", 32),
    "16 bits": ("c-fixed", 16),
    "float": ("c-float", 0),
    "double": ("c", 0),
}
#: Titles of the tables: the kernel of each, and what it shows.
TABLES = {
    "Euler parameters, instructions executed in a call": ("euler", "executed"),
    "Direction cosines, instructions executed in a call": ("dcm", "executed"),
    "Euler parameters, bytes of code": ("euler", "code_bytes"),
    "Euler parameters, bytes of stack": ("euler", "stack_bytes"),
}


@cache
def sources(algorithm: str, column: str) -> Sources:
    """Return the files of a step as a column of the tables has it."""
    target, word = COLUMNS[BY_HAND if column in HAND_WRITTEN else column]
    settings = Settings.of(word=word, max_rate_deg_s=400, step="0.01", increments=2) if word else None
    generated = pipeline.compile(catalogue.choose_step(algorithm, "rk4", 2), target, settings)
    if column not in HAND_WRITTEN:
        return generated
    files = {name: (HERE / name).read_text() for name in ("by_hand.h", HAND_WRITTEN[column])}
    return replace(generated, files=files, function=replace(generated.function, name="by_hand"))


def measured(algorithm: str, column: str, cpu: str) -> Cost | None:
    """Return what a step costs on a processor; None where it is not there."""
    if (algorithm == "dcm" and column == BY_HAND) or (cpu == "avr" and column == "double"):
        return None  # the double of avr-gcc 5.4 has 32 bits
    return cost.cost(sources(algorithm, column), cpu)


def rows(cpu: str, algorithms: Sequence[str] = ("euler", "dcm")) -> Iterator[tuple[str, str]]:
    """Yield the row of a processor in each table that has it, after the table's title."""
    costs = {
        algorithm: {column: measured(algorithm, column, cpu) for column in COLUMNS}
        for algorithm in algorithms
    }
    for title, (algorithm, what) in TABLES.items():
        if algorithm not in costs:
            continue
        shown = {
            name: one for name, one in costs[algorithm].items() if name != BY_HAND or algorithm == "euler"
        }
        values = [None if one is None else getattr(one, what) for one in shown.values()]
        if any(value is not None for value in values):
            cells = ["–" if value is None else f"{value:,}" for value in values]
            yield title, f"| {' | '.join([cpu, *cells])} |"


def errors(column: str, count: int = 2000) -> tuple[float, float]:
    """Return the largest and the root mean square distance of a call from exact arithmetic, in units of the last place.

    The states are of length 1 and half of the increments at the ends of their range.
    """
    fixed = sources("euler", column).fixed
    assert fixed is not None
    state, increments = fixed.inputs
    rng = np.random.default_rng(1969)
    attitudes = rng.normal(size=(count, 4))
    attitudes /= np.linalg.norm(attitudes, axis=-1, keepdims=True)
    e = np.rint(attitudes / float(state.format.unit)).astype(np.int32)
    d = rng.integers(increments.low, increments.high, (count, 6), endpoint=True).astype(np.int32)
    d[::2] = rng.choice([increments.low, increments.high], (len(d[::2]), 6))
    program = pipeline.program(catalogue.choose_step("euler", "rk4", 2))
    apart = []
    for one, angles, result in zip(e, d, _called(sources("euler", column), e, d), strict=True):
        numbers = ([int(x) * a.format.unit for x in row] for row, a in ((one, state), (angles, increments)))
        exact = _exact(program, *numbers)
        apart += [float(int(x) - value / state.format.unit) for x, value in zip(result, exact, strict=True)]
    return float(np.abs(apart).max()), float(np.sqrt(np.mean(np.square(apart))))


def _exact(program: Program, state: list[Fraction], increments: list[Fraction]) -> list[Fraction]:
    """Return the state after a step in exact fractions."""
    names = [element for signal in program.inputs for element in signal.elements]
    (result,) = program.run(dict(zip(names, [*state, *increments], strict=True)), Fraction).values()
    return [*result]


def _called(step: Sources, states: np.ndarray, increments: np.ndarray) -> np.ndarray:
    """Return the integers that a step in C returns for arrays of integers."""
    with tempfile.TemporaryDirectory() as name:
        for file, text in step.step_files.items():
            (Path(name) / file).write_text(text)
        files = [file for file in step.step_files if file.endswith(".c")]
        command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", *files, "-o", "step.so"]
        subprocess.run(command, cwd=name, check=True)
        function = getattr(ctypes.CDLL(str(Path(name) / "step.so")), step.function.name)
    results = np.empty_like(states)
    for arrays in zip(states, increments, results, strict=True):
        if function(*(array.ctypes.data_as(ctypes.c_void_p) for array in arrays)):
            raise RuntimeError(f"{step.function.name} refused its input")
    return results


def main() -> None:
    """Measure and print the tables."""
    lines: dict[str, list[str]] = {title: [] for title in TABLES}
    for cpu in PROCESSORS:
        for title, row in rows(cpu):
            lines[title].append(row)
    for title, table in lines.items():
        print(title, "", *table, "", sep="\n")
    for column in ("32 bits", *HAND_WRITTEN):
        largest, rms = errors(column)
        executed = cost.cost(sources("euler", column), cost.REFERENCE).executed
        print(f"{column}: {executed} executed; error at most {largest:.2f}, rms {rms:.2f} of the last place")


if __name__ == "__main__":
    main()
