"""Reports the simulated tables of the thesis as text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.thesis.thesis_tables import ALGORITHMS, ORDERS, TABLES, Table, TableEntry

#: What the algorithms are called.
NAMES = {"dcm": "direction cosines", "euler": "Euler parameters"}
#: Drift and ratio at one order, and the mark behind them.
_FIGURES = (
    Column("drift", spec=".4g", least=9),
    Column("ratio", spec=".4g", least=9),
    Column(align="<", least=1, gap=0),
)
#: Width of the notes in characters.
_WIDTH = 90


def thesis_table_text(table: Table, entries: Sequence[TableEntry]) -> str:
    """Return one table as text: for each algorithm the thesis's line, then one for each back end.

    Where the thesis's figures are repaired, a line below has what the scan reads.
    """
    backends = list(dict.fromkeys(entry.backend for entry in entries))
    label = Column(align="<", least=max([7, *map(len, backends)]))
    rows: list[list[Any]] = []
    ends = [0]
    for algorithm in ALGORITHMS:
        rows += _printed_rows(table, algorithm)
        rows += [_row(entries, backend, algorithm) for backend in backends]
        ends.append(len(rows))
    head, *lines = TextTable([label, *_FIGURES * len(ORDERS)], rows).lines("    ")
    # An order stands over the middle of its figures.
    orders = [Column(f"order {order}", least=18, gap=5 if k else 2) for k, order in enumerate(ORDERS)]
    ratio = "of the same order" if table.by_order else "of first order"
    text = [
        f"Table {table.number}: {table.title}",
        f"  drift in deg, and its ratio to that of direction cosines {ratio}",
        *TextTable([label, *orders], []).lines("    "),
        head,
    ]
    for algorithm, (first, stop) in zip(ALGORITHMS, pairwise(ends), strict=True):
        text += [f"  {NAMES[algorithm]}", *lines[first:stop]]
    return "\n".join([*text, *_notes(entries), *repair_notes(table)])


@dataclass(frozen=True)
class ThesisTablesResult(Result):
    """The tables of the thesis beside simulations: a row for each figure and back end."""

    rows_in = "entries"
    row = TableEntry
    drawn_by = "strapgen.thesis.tables_plot:thesis_tables_image"

    entries: Sequence[TableEntry]

    def text(self) -> str:
        """Return one table after the other."""
        of_tables = ((table, [e for e in self.entries if e.table == table.number]) for table in TABLES)
        return "\n\n".join(thesis_table_text(table, here) for table, here in of_tables if here)


def repair_notes(table: Table) -> list[str]:
    """Return what is repaired of a table of the thesis, as lines for a reader."""
    sentences = (each.sentence for each in table.repairs)
    return [f"  {line}" for sentence in sentences for line in textwrap.wrap(sentence, _WIDTH)]


def _printed_rows(table: Table, algorithm: str) -> list[list[Any]]:
    """Return the figures that the thesis prints of an algorithm, and what the scan reads where they are repaired."""
    row, scan = ["thesis"], ["scan"]
    for order, figure in zip(ORDERS, table.printed[algorithm], strict=True):
        row += [table.base if (algorithm, order) == ("dcm", 1) else "", figure, ""]
        repair = table.repair(algorithm, order)
        scan += ["", "" if repair is None else repair.scan, ""]
    return [row, scan] if any(scan[1:]) else [row]


def _row(entries: Sequence[TableEntry], backend: str, algorithm: str) -> list[Any]:
    """Return the simulated figures of an algorithm on a back end."""
    row: list[Any] = [backend]
    for entry in entries:
        if (entry.backend, entry.algorithm) == (backend, algorithm):
            row += [entry.drift_deg, entry.normalised, _mark(entry)]
    return row


def _mark(entry: TableEntry) -> str:
    """Return what stands behind a figure: round-off says more than that the figure is not the thesis's."""
    return "r" if entry.roundoff_dominates else "" if entry.agrees else "*"


def _notes(entries: Sequence[TableEntry]) -> list[str]:
    """Return what the marks mean that stand in the table, and what is to be said about figures of the thesis."""
    lines = []
    if not all(entry.agrees for entry in entries):
        lines.append("  * not the thesis's figure in its printed digits")
    if any(entry.roundoff_dominates for entry in entries):
        lines.append("  r round-off dominates: over half of what the method itself loses")
    notes: dict[tuple[str, int], str] = {}
    for entry in entries:
        if entry.note:  # back ends differ in its figures alone; the first one's stand for all
            notes.setdefault((entry.algorithm, entry.order), entry.note)
    return lines + [f"  {line}" for note in notes.values() for line in textwrap.wrap(note, _WIDTH)]
