"""Lays out what kernels cost on microcontrollers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from strapgen.experiments.cost import Cost
from strapgen.reports.report import Report
from strapgen.reports.table import Column, TextTable

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


def cost_report(costs: Sequence[Cost]) -> Report:
    """Return what kernels cost as a report."""
    return Report(lambda: _text(costs), lambda: _data(costs), lambda: _table(costs))


def _data(costs: Sequence[Cost]) -> list[dict[str, Any]]:
    return [asdict(cost) for cost in costs]


def _table(costs: Sequence[Cost]) -> TextTable:
    columns = [
        Column(heading, "<" if name in ("kernel", "cpu") else ">") for name, heading in _HEADINGS.items()
    ]
    return TextTable(columns, [[asdict(cost)[name] for name in _HEADINGS] for cost in costs])


def _text(costs: Sequence[Cost]) -> str:
    compilers = "\n".join(dict.fromkeys(f"compiled by {cost.compiler} -O2" for cost in costs))
    return (
        f"{_table(costs).as_text()}\n\n"
        "executed: instructions of one call, for input inside its range\n"
        f"{compilers}"
    )
