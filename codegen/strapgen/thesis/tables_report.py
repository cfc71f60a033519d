"""Reports the simulated tables of the thesis as text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from strapgen.results import figures
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.thesis.thesis_tables import ALGORITHMS, ORDERS, TABLES, Table, TableEntry

if TYPE_CHECKING:
    from strapgen.thesis.predicted_tables import PredictedTablesResult

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

_COLOURS = dict(zip(ALGORITHMS, figures.COLOURS, strict=False))
_MARKERS = "osD^vP*X"
#: Width that the marks of an algorithm take at an order, where orders are 1 apart, and the place of their middle.
_BREADTH, _ASIDE = 0.34, 0.22
#: Characters of a line over a panel.
_PANEL_WIDTH = 66


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
    row: ClassVar[type | None] = TableEntry
    drawn_by: ClassVar[str] = "strapgen.thesis.tables_report:thesis_tables_image"

    entries: Sequence[TableEntry]

    def text(self) -> str:
        """Return one table after the other."""
        of_tables = ((table, [e for e in self.entries if e.table == table.number]) for table in TABLES)
        return "\n\n".join(thesis_table_text(table, here) for table, here in of_tables if here)


def repair_notes(table: Table) -> list[str]:
    """Return the repairs of a table of the thesis, as lines for a reader."""
    sentences = (each.sentence for each in table.repairs)
    return [f"  {line}" for sentence in sentences for line in textwrap.wrap(sentence, _WIDTH)]


def _printed_rows(table: Table, algorithm: str) -> list[list[Any]]:
    """Return the printed figures of an algorithm, and the misread ones of the scan where they are repaired."""
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
    """Return the mark of a figure: round-off, or else a difference from the thesis."""
    return "r" if entry.roundoff_dominates else "" if entry.agrees else "*"


def _notes(entries: Sequence[TableEntry]) -> list[str]:
    """Return the notes of a table: the meaning of its marks, and remarks on figures of the thesis."""
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


class _Figure(NamedTuple):
    """One computed figure of a table: the drift as a ratio, and in deg."""

    table: int
    algorithm: str
    order: int
    series: str
    ratio: float
    drift_deg: float
    agrees: bool


def thesis_tables_image(result: ThesisTablesResult, path: str | Path) -> bytes:
    """Return tables of the thesis as panels: the ratio of each drift over the order, of both representations.

    A bar is the figure that the thesis prints; beside it stands a mark for each back end, filled where it has the
    thesis's digits.
    """
    return _image(
        [
            _Figure(e.table, e.algorithm, e.order, e.backend, e.normalised, e.drift_deg, e.agrees)
            for e in result.entries
        ],
        path,
    )


def predicted_tables_image(result: PredictedTablesResult, path: str | Path) -> bytes:
    """Return predicted tables as `thesis_tables_image` does simulated ones, beside a simulation in numpy."""
    predicted = [
        _Figure(e.table, e.algorithm, e.order, "predicted", e.normalised, e.drift_deg, e.agrees)
        for e in result.entries
    ]
    simulated = [
        _Figure(e.table, e.algorithm, e.order, "simulated", e.simulated, e.simulated_deg, e.agrees_simulated)
        for e in result.entries
    ]
    return _image([*predicted, *simulated], path)


def _image(entries: Sequence[_Figure], path: str | Path) -> bytes:
    """Draw a panel for each table."""
    tables = [table for table in TABLES if any(entry.table == table.number for entry in entries)]
    columns = min(3, len(tables))
    rows = -(-len(tables) // columns)
    figure, grid = figures.pyplot().subplots(
        rows, columns, figsize=(2.6 + 4.1 * columns, 1.6 + 3.7 * rows), layout="constrained", squeeze=False
    )
    for axes, table in zip(grid.flat, tables, strict=False):
        _draw_table(axes, table, [entry for entry in entries if entry.table == table.number])
    for axes in list(grid.flat)[len(tables) :]:
        axes.set_visible(False)
    series = list(dict.fromkeys(entry.series for entry in entries))
    figures.title(
        figure,
        "ratios of drifts, beside the thesis's figures; in brackets what its scan reads where they are repaired",
    )
    figure.legend(
        *_legend(series), frameon=False, fontsize=9, loc="outside lower center", ncols=min(6, 1 + 2 * columns)
    )
    return figures.image(figure, path)


def _draw_table(axes: Any, table: Table, entries: Sequence[_Figure]) -> None:
    """Draw the printed and the computed figures of one table."""
    series = list(dict.fromkeys(entry.series for entry in entries))
    for entry in entries:
        place = _place(entry.algorithm, entry.order)
        shift = (series.index(entry.series) + 0.5) / len(series) - 0.5
        colour = _COLOURS[entry.algorithm]
        axes.plot(
            place + shift * _BREADTH,
            entry.ratio,
            linestyle="none",
            marker=_MARKERS[series.index(entry.series) % len(_MARKERS)],
            markersize=6,
            color=colour,
            markerfacecolor=colour if entry.agrees else "white",
        )
    for algorithm in ALGORITHMS:
        for order, printed in zip(ORDERS, table.printed[algorithm], strict=True):
            place, half = _place(algorithm, order), _BREADTH / 2 + 0.05
            axes.hlines(
                float(Fraction(printed)), place - half, place + half, color="0.15", linewidth=1.6, zorder=1
            )
            repair = table.repair(algorithm, order)
            axes.annotate(
                printed if repair is None else f"{printed}\n[{repair.scan}]",
                (place, float(Fraction(printed))),
                xytext=(0, -4),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=8,
                color="0.15",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.8},
                zorder=1,
            )
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(low / (high / low) ** 0.06, high)
    axes.set_xticks(range(len(ORDERS)), [f"order {order}" for order in ORDERS])
    axes.set_xlim(-0.5, len(ORDERS) - 0.5)
    axes.set_ylabel(f"drift / drift of direction cosines,\n{'same' if table.by_order else 'first'} order")
    axes.set_title(_title(table, entries), loc="left", fontsize=9.5)
    figures.style(axes, grid="y")


def _title(table: Table, entries: Sequence[_Figure]) -> str:
    """Return the name of a table, and the drift that the ratio 1 stands for."""
    lines = textwrap.wrap(f"Table {table.number}: {table.title}", _PANEL_WIDTH)
    first = next(entry for entry in entries if (entry.algorithm, entry.order) == (ALGORITHMS[0], ORDERS[0]))
    if not table.by_order:
        printed = f", in the thesis {table.base}" if table.base else ""
        lines.append(f"ratio 1 is {first.drift_deg:.3g} deg{printed}")
    return "\n".join(lines)


def _place(algorithm: str, order: int) -> float:
    """Return the position of the marks of an algorithm at an order."""
    return ORDERS.index(order) + (_ASIDE if ALGORITHMS.index(algorithm) else -_ASIDE)


def _legend(series: Sequence[str]) -> tuple[list[Any], list[str]]:
    """Return handles and labels: colours for the algorithms, marks for the series, the bar of the thesis."""
    from matplotlib.lines import Line2D

    def mark(marker: str, colour: str, face: str) -> Any:
        return Line2D(
            [], [], linestyle="none", marker=marker, markersize=6, color=colour, markerfacecolor=face
        )

    handles = [Line2D([], [], color="0.15", linewidth=1.6)]
    labels = ["figure of the thesis"]
    for algorithm in ALGORITHMS:
        handles.append(Line2D([], [], color=_COLOURS[algorithm], linewidth=6))
        labels.append(NAMES[algorithm])
    for number, name in enumerate(series):
        handles.append(mark(_MARKERS[number % len(_MARKERS)], "0.35", "0.35"))
        labels.append(name)
    handles.append(mark("o", "0.35", "white"))
    labels.append("open: not the thesis's digits")
    return handles, labels
