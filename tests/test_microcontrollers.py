"""The figures of docs/microcontrollers.md and generated/COST.md are those that the commands measure."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from derived import FIXED_POINT

from strapgen import pipeline
from strapgen.ir.exceptions import CompilerError
from strapgen.lab import cost
from strapgen.lab.cost import EVERYWHERE, REFERENCE, Cost, CostResult
from strapgen.lab.processors import PROCESSORS

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "microcontrollers.md").read_text()
COST = ROOT / "generated" / "COST.md"
PARTS = ("steps", "others")


@cache
def script() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "benchmarks" / "microcontrollers.py"))


def table(title: str) -> dict[str, str]:
    """Return the rows of a table of the page by their first cells."""
    lines = PAGE.partition(f"\n{title}")[2].partition("\n|")[2].split("\n\n")[0].splitlines()
    return {line.split(" | ")[0].strip("| "): line for line in lines[2:]}


def needed(cpu: str, text: str) -> None:
    """Skip a test where the compiler of a processor, in the version that a text names, or its emulator is missing."""
    processor = PROCESSORS[cpu]
    for program in (processor.compiler, *processor.emulator[:1]):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not on this machine")
    said = subprocess.run(
        [processor.compiler, "--version"], capture_output=True, text=True, check=True
    ).stdout
    version = re.search(r"\) (\S+)", said)
    if version is None or f"{processor.compiler} {version[1]}" not in re.sub(r"\s+", " ", text):
        pytest.skip(f"{said.splitlines()[0]} is another version than that of the figures")


@pytest.mark.long
@pytest.mark.parametrize("cpu", PROCESSORS)
def test_the_tables_of_the_page_are_those_of_the_command(cpu):
    needed(cpu, PAGE)
    # A step in direction cosines that differs does so on every processor.
    algorithms = ("euler", "dcm") if cpu == REFERENCE else ("euler",)
    measured = dict(script()["rows"](cpu, algorithms))
    assert len(measured) == 2 + (len(algorithms) if PROCESSORS[cpu].emulator else 0)
    assert {title: table(title).get(cpu) for title in measured} == measured


def test_the_page_has_a_row_for_every_processor():
    for title, (_, what) in script()["TABLES"].items():
        named = {cpu for cpu in PROCESSORS if what != "executed" or PROCESSORS[cpu].emulator}
        assert table(title).keys() == named


@pytest.mark.long
def test_the_steps_by_hand_are_compared_as_the_page_says():
    needed(REFERENCE, PAGE)
    shown = table("## Beside a step written by hand")
    assert shown.keys() == {"32 bits", *script()["HAND_WRITTEN"]}
    for column, row in shown.items():
        largest, rms = script()["errors"](column)
        executed = cost.cost(script()["sources"]("euler", column), REFERENCE).executed
        assert row.strip("| ").split(" | ")[2:] == [str(executed), f"{largest:.2f}", f"{rms:.2f}"]
    program = script()["sources"]("euler", "32 bits")
    assert program.operations["multiply"] == int(shown["32 bits"].split(" | ")[1])
    bound = float(max(program.fixed.outputs[0].errors) / program.fixed.outputs[0].format.unit)
    assert f"at most {bound:.4f}." in PAGE


# The whole catalogue


def rows() -> Iterator[Cost]:
    """Yield the rows of the page of the catalogue, with the compiler that it names."""
    text = COST.read_text()
    versions = dict(re.findall(r"^compiled by (\S+) (\S+) -O2$", text, flags=re.MULTILINE))
    for line in re.findall(r"^\| ([a-z].*-.*) \|$", text, flags=re.MULTILINE):
        kernel, cpu, *figures = line.split(" | ")
        compiler = PROCESSORS[cpu].compiler
        numbers = [None if figure == "-" else int(figure) for figure in figures]
        yield Cost(kernel, cpu, *numbers, f"{compiler} {versions[compiler]}")


def test_the_page_of_the_catalogue_has_all_kernels_and_processors():
    costs = [*rows()]
    assert CostResult(costs, of_catalogue=True).written("markdown") + "\n" == COST.read_text()
    assert [one.kernel for one in costs if one.cpu == REFERENCE] == [choice.kernel for choice in FIXED_POINT]
    for cpu in PROCESSORS.keys() - {REFERENCE}:
        assert {one.kernel for one in costs if one.cpu == cpu} == {*EVERYWHERE}


@pytest.mark.long
@pytest.mark.parametrize(
    ("cpu", "part"),
    [(REFERENCE, part) for part in PARTS] + [(cpu, "steps") for cpu in PROCESSORS if cpu != REFERENCE],
)
def test_cost_page_has_the_measured_numbers(cpu, part):
    needed(cpu, COST.read_text())
    pages = {one.kernel: one for one in rows() if one.cpu == cpu}
    for choice in FIXED_POINT:
        if choice.kernel in pages and (part == "steps") == (choice.method is not None):
            sources = pipeline.compile(choice, "c-fixed")
            assert cost.cost(sources, cpu) == pages[choice.kernel]


def test_a_call_that_is_refused_is_no_measurement(tmp_path):
    """A function that returns early executes few instructions."""
    needed(REFERENCE, PAGE)
    sources = script()["sources"]("euler", "by hand")
    text = sources.files["by_hand.c"].replace("> limit", "> 0")
    refusing = type(sources)(**(vars(sources) | {"files": sources.files | {"by_hand.c": text}}))
    with pytest.raises(CompilerError, match="by_hand refuses the input with which it is measured"):
        cost.cost(refusing, REFERENCE)
