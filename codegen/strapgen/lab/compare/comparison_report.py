"""Reports a comparison of back ends in every format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from strapgen.lab.compare.comparison import Comparison
from strapgen.results.report import Report
from strapgen.results.table import ANGLE, Column, TextTable

_COLUMNS = (
    Column("", "<"),
    Column("largest", spec=ANGLE),
    Column("rms", spec=ANGLE),
    Column("certified", spec=ANGLE),
    Column("ulp", spec=".3g"),
    Column("drift", spec=".4g"),
    Column("ns/step", spec=".1f"),
    Column("bytes"),
    Column("operations", "<"),
)
#: The headers of these columns where nothing above the table states the units.
_HEADERS = (
    *("back end", "largest angle, rad", "rms angle, rad", "certified, rad", "largest, ulp", "drift, deg"),
    *("ns/step", "bytes", "operations"),
)


@dataclass(frozen=True)
class ComparedKernel:
    """The back ends of one kernel, compared."""

    kernel: str
    #: The kernel and its run in words
    title: str
    #: One for every back end
    rows: Sequence[Comparison]
    #: Length of a step in s, which a plot needs
    step_s: float = 1.0


def comparison_report(kernels: Sequence[ComparedKernel], reference: str, drift: str) -> Report:
    """Return comparisons of several kernels as a report; parameters as for `comparison_text`."""

    def text() -> str:
        return "\n\n".join(comparison_text(one.rows, one.title, reference, drift) for one in kernels)

    def data() -> list[dict[str, Any]]:
        return [row.as_dict() | {"kernel": one.kernel} for one in kernels for row in one.rows]

    def markdown() -> TextTable:
        rows = [[one.kernel, *_cells(row)] for one in kernels for row in one.rows]
        return TextTable([Column("kernel", "<"), Column("back end", "<"), *_COLUMNS[1:]], rows)

    return Report(text, data, lambda: _table(kernels), markdown)


def _table(kernels: Sequence[ComparedKernel]) -> TextTable:
    """Return all figures of all rows; a column for every kind of operation."""
    table = figures_table([row for one in kernels for row in one.rows])
    names = [one.kernel for one in kernels for _ in one.rows]
    values = [[*row, name] for row, name in zip(table.rows, names, strict=True)]
    return TextTable([*table.columns, Column("kernel")], values)


def comparison_text(rows: Sequence[Comparison], title: str, reference: str, drift: str) -> str:
    """Return comparisons as text: a row for every back end."""
    lines = [
        title,
        f"angle from {reference} in rad, difference of the state in units of the last place;",
        f"{drift} in deg; time of a run with all states kept",
        "",
    ]
    return "\n".join([*lines, *TextTable(_COLUMNS, [_cells(row) for row in rows]).lines()])


def comparison_table(rows: Sequence[Comparison]) -> TextTable:
    """Return comparisons as a table for a reader, the units in its headers; parameters as for `comparison_text`."""
    columns = [replace(column, header=header) for column, header in zip(_COLUMNS, _HEADERS, strict=True)]
    return TextTable(columns, [_cells(row) for row in rows])


def figures_table(rows: Sequence[Comparison]) -> TextTable:
    """Return all figures of comparisons under the names of their fields, which have the units."""
    names = [field.name for field in fields(Comparison) if field.name not in ("operations", "history")]
    kinds = list(dict.fromkeys(kind for row in rows for kind in row.operations))
    values = [
        [*(getattr(row, name) for name in names), *(row.operations.get(kind, 0) for kind in kinds)]
        for row in rows
    ]
    return TextTable([Column(name) for name in (*names, *kinds)], values)


def _cells(row: Comparison) -> list[Any]:
    return [
        row.backend,
        row.max_abs_rad,
        row.rms_rad,
        row.bound_rad,
        row.max_ulp,
        row.drift_deg,
        row.ns_per_step,
        row.bytes,
        ", ".join(f"{number} {kind}" for kind, number in row.operations.items() if number),
    ]
