"""Reports a comparison of back ends that run a described system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from strapgen.navigation.systems.system_comparison import OutputComparison
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_SYSTEM_COLUMNS = (
    Column("", "<"),
    Column("output", "<"),
    Column("unit", "<"),
    Column("run", spec=".3g"),
    Column("one pass", spec=".3g"),
    Column("certified", spec=".3g"),
)


def system_comparison_report(rows: Sequence[OutputComparison], title: str, reference: str) -> Report:
    """Return the outputs of a described system on several back ends as a report.

    `title`: the system and its run in words.
    """

    def table() -> TextTable:
        names = [field.name for field in fields(OutputComparison)]
        return TextTable(
            [Column(name) for name in names], [[getattr(row, name) for name in names] for row in rows]
        )

    def shown() -> TextTable:
        return TextTable(
            _SYSTEM_COLUMNS,
            [[row.backend, row.output, row.unit, row.run, row.one_pass, row.bound] for row in rows],
        )

    def text() -> str:
        lines = [
            title,
            f"largest difference of an element from {reference}: over the run, where differences add up, and after",
            "one pass from equal memories, beside the certified bound of a pass",
            "",
            *shown().lines(),
        ]
        reasons = dict.fromkeys(
            f"no bound of {row.output}: {row.reason}"
            for row in rows
            if row.one_pass is not None and row.reason
        )
        return "\n".join([*lines, *reasons])

    return Report(text, lambda: [row.as_dict() for row in rows], table, shown)
