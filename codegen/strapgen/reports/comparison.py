"""Reports a comparison of back ends as text, JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from strapgen.experiments.comparison import Comparison
from strapgen.reports.table import ANGLE, Column, TextTable

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


def comparison_json(rows: Sequence[Comparison]) -> str:
    """Return comparisons as a JSON list."""
    return json.dumps([row.as_dict() for row in rows])


def comparison_csv(rows: Sequence[Comparison]) -> str:
    """Return comparisons as comma-separated values; a column for every kind of operation."""
    kinds = list(dict.fromkeys(kind for row in rows for kind in row.operations))
    names = [field.name for field in fields(Comparison) if field.name != "operations"]
    values = [
        [*(getattr(row, name) for name in names), *(row.operations.get(kind, 0) for kind in kinds)]
        for row in rows
    ]
    return TextTable([Column(name) for name in (*names, *kinds)], values).as_csv()


def comparison_text(rows: Sequence[Comparison], title: str, reference: str, drift: str) -> str:
    """Return comparisons as text: a row for every back end.

    Parameters
    ----------
    rows : sequence of Comparison
    title : str
    reference : str
        What the angles are measured from.
    drift : str
        What the drift is, as in "mean drift".
    """
    lines = [
        title,
        f"angle from {reference} in rad, difference of the state in units of the last place;",
        f"{drift} in deg; time of a run with all states kept",
        "",
    ]
    return "\n".join([*lines, *TextTable(_COLUMNS, [_cells(row) for row in rows]).lines()])


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
