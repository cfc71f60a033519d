"""Back ends side by side, as text, JSON and CSV."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import fields

from strapgen.experiments.comparison import Comparison


def comparison_json(rows: Sequence[Comparison]) -> str:
    """Return comparisons as a JSON list."""
    return json.dumps([row.as_dict() for row in rows])


def comparison_csv(rows: Sequence[Comparison]) -> str:
    """Return comparisons as comma-separated values; a column for every kind of operation."""
    kinds = list(dict.fromkeys(kind for row in rows for kind in row.operations))
    names = [field.name for field in fields(Comparison) if field.name != "operations"]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([*names, *kinds])
    for row in rows:
        values = [getattr(row, name) for name in names]
        writer.writerow(
            ["" if value is None else value for value in values] + [row.operations.get(k, 0) for k in kinds]
        )
    return buffer.getvalue()


def comparison_text(rows: Sequence[Comparison], title: str, reference: str, drift: str) -> str:
    """Return comparisons as a table for a reader."""
    lines = [
        title,
        f"angle from {reference} in rad, difference of the state in units of the last place;",
        f"{drift} in deg; time of a run with all states kept",
        "",
    ]
    head = ["", "largest", "rms", "certified", "places", "drift", "ns/step", "bytes", "operations"]
    table = [head, *(_cells(row) for row in rows)]
    widths = [max(len(line[k]) for line in table) for k in range(len(head))]
    for line in table:
        first = f"{line[0]:<{widths[0]}}"
        rest = [f"{cell:>{width}}" for cell, width in zip(line[1:-1], widths[1:-1], strict=True)]
        lines.append("  ".join([first, *rest, line[-1]]).rstrip())
    return "\n".join(lines)


def _cells(row: Comparison) -> list[str]:
    counts = ", ".join(f"{number} {kind}" for kind, number in row.operations.items() if number)
    return [
        row.backend,
        f"{row.max_abs_rad:.3g}",
        f"{row.rms_rad:.3g}",
        "-" if row.bound_rad is None else f"{row.bound_rad:.3g}",
        f"{row.max_ulp:.3g}",
        f"{row.drift_deg:.4g}",
        f"{row.ns_per_step:.1f}",
        "-" if row.bytes is None else str(row.bytes),
        counts,
    ]
