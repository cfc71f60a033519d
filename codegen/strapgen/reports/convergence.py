"""Observed orders as text and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass
from strapgen.experiments.convergence import Convergence, Rung

#: Algorithms side by side in a report.
_COLUMNS = 4


def convergence_text(found: Sequence[Convergence], title: str) -> str:
    """Return outcomes as a report: the error and the local slope at every step, the observed and predicted orders."""
    lines = [title, "largest error in rad; in brackets the slope from the step before; * fitted"]
    for first in range(0, len(found), _COLUMNS):
        lines += ["", *_table(found[first : first + _COLUMNS])]
    notes = [f"{one.kernel}: {one.order}" for one in found if one.order is not None and one.order.limited]
    notes += [f"{one.kernel}: {one.hidden}" for one in found if one.hidden]
    return "\n".join([*lines, *([""] if notes else []), *notes])


def _table(found: Sequence[Convergence]) -> list[str]:
    rows = [["step, s", *(one.kernel for one in found)]]
    for k, rung in enumerate(found[0].rungs):
        rows.append([f"{rung.step_s:.6g}", *(_cell(one.rungs[k]) for one in found)])
    rows.append(["observed", *("-" if one.observed is None else f"{one.observed:.3f} " for one in found)])
    rows.append(["predicted", *("-" if one.predicted is None else f"{one.predicted}     " for one in found)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _cell(rung: Rung) -> str:
    if rung.error_rad is None:
        return "out of range "
    slope = "" if rung.slope is None else f" ({rung.slope:.2f})"
    return f"{rung.error_rad:.3e}{slope}{'*' if rung.used else ' '}"


def convergence_csv(found: Sequence[Convergence]) -> str:
    """Return outcomes as comma-separated values, a row for every step of every algorithm."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ["kernel", "backend", "step_s", "error_rad", "slope", "used", "observed_order", "predicted_order"]
    )
    for one in found:
        for rung in one.rungs:
            row = [one.kernel, one.backend, rung.step_s, rung.error_rad, rung.slope, rung.used]
            writer.writerow(["" if value is None else value for value in (*row, one.observed, one.predicted)])
    return buffer.getvalue()
