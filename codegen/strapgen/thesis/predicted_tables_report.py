"""Reports the tables of the thesis, as the series predict them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.analysis.ratios import Claim, claims_text
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.thesis.predicted_tables import PredictedEntry
from strapgen.thesis.tables_report import repair_notes
from strapgen.thesis.thesis_tables import TABLES

_COLUMNS = (
    Column("", "<", least=20),
    Column("predicted", spec=".4g", least=9),
    Column("simulated", spec=".4g", least=9),
    Column("ratio", spec=".4g", least=10),
    Column("simulated", spec=".4g", least=9),
    Column("off by", spec="+.2%", least=7),
    Column("thesis", least=8),
    Column("", "<", gap=1),
    Column("scan", least=7, missing=""),
)


def predicted_text(entries: Sequence[PredictedEntry]) -> str:
    """Return predicted tables as text."""
    lines = []
    for table in TABLES:
        rows = [_cells(entry) for entry in entries if entry.table == table.number]
        if not rows:
            continue
        ratio = "of the same order" if table.by_order else "of first order"
        lines += [
            f"Table {table.number}: {table.title}",
            f"  drift in deg, and its ratio to that of direction cosines {ratio}",
            *TextTable(_COLUMNS, rows).lines("  "),
            *repair_notes(table),
            "",
        ]
    if not all(entry.agrees for entry in entries):
        lines.append("* not the thesis's figure in its printed digits\n")
    return "\n".join(lines)


@dataclass(frozen=True)
class PredictedTablesResult(Result):
    """The tables of the thesis as the series predict them, and the ratios that the thesis reads from them."""

    rows_in = "entries"
    drawn_by = "strapgen.thesis.tables_plot:predicted_tables_image"

    entries: Sequence[PredictedEntry]
    ratios: Sequence[Claim]

    def text(self) -> str:
        """Return the tables and the ratios."""
        return f"{predicted_text(self.entries)}\n{claims_text(self.ratios)}"


def _cells(entry: PredictedEntry) -> tuple[str | float | None, ...]:
    return (
        f"{entry.algorithm}, order {entry.order}",
        entry.drift_deg,
        entry.simulated_deg,
        entry.normalised,
        entry.simulated,
        entry.deviation,
        entry.thesis,
        "" if entry.agrees else "*",
        entry.scan,
    )
