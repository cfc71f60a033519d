"""Lays out what kernels cost on microcontrollers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from strapgen.lab.cost.cost import Cost
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_HEADINGS = {
    "kernel": "kernel",
    "cpu": "cpu",
    "instructions": "instructions",
    "executed": "executed",
    "multiplications": "multiplications",
    "code_bytes": "code, B",
    "constant_bytes": "constants, B",
    "stack_bytes": "stack, B",
}
#: What stands above the table of the standard catalogue.
_HEAD = """# What the standard catalogue costs

Written by `strapgen cost --all --format markdown --out generated/COST.md`.

The kernels of `c_fixed/`, 32-bit fixed point for increments of up to 1/8 rad: all of them on a Cortex-M3, the steps of
fourth order on every processor. None of the processors is given a floating-point unit. `executed` are the instructions
of one call under QEMU, from the entry of the function to its return, for input inside its range; `stack` is that of the
function and of the deepest function of its file that it calls.
"""


def cost_report(costs: Sequence[Cost]) -> Report:
    """Return what kernels cost as a report."""
    return Report(lambda: _text(costs), lambda: _data(costs), lambda: _table(costs))


def catalogue_report(costs: Sequence[Cost]) -> Report:
    """Return what the standard catalogue costs as a report, in Markdown as a page."""
    table = _table(costs)
    page = _Page(table.columns, table.rows, _compilers(costs))
    return Report(lambda: _text(costs), lambda: _data(costs), lambda: table, lambda: page)


@dataclass(frozen=True)
class _Page(TextTable):
    """A table that stands in a page of its own in Markdown."""

    compilers: str = ""

    def as_markdown(self) -> str:
        """Return the page."""
        return f"{_HEAD}\n{super().as_markdown()}\n\n{self.compilers}"


def _data(costs: Sequence[Cost]) -> list[dict[str, Any]]:
    return [asdict(cost) for cost in costs]


def _table(costs: Sequence[Cost]) -> TextTable:
    columns = [
        Column(heading, "<" if name in ("kernel", "cpu") else ">") for name, heading in _HEADINGS.items()
    ]
    return TextTable(columns, [[asdict(cost)[name] for name in _HEADINGS] for cost in costs])


def _text(costs: Sequence[Cost]) -> str:
    return (
        f"{_table(costs).as_text()}\n\n"
        "executed: instructions of one call, for input inside its range\n"
        f"{_compilers(costs)}"
    )


def _compilers(costs: Sequence[Cost]) -> str:
    return "\n".join(dict.fromkeys(f"compiled by {cost.compiler} -O2" for cost in costs))
