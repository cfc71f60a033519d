"""Reports the rate-table test."""

from __future__ import annotations

import math
from collections.abc import Sequence

from strapgen.navigation.rate_table.rate_table import RATE_DEG_S, Row
from strapgen.results.report import Report, flat_table
from strapgen.results.table import ERROR, Column, TextTable


def rate_table_text(rows: Sequence[Row], duration: str, sample: str) -> str:
    """Return rows as a table for each motion: a line an algorithm, a column a back end.

    `duration, sample`: duration of the test, and time between gyro samples, in s.
    """
    backends = list(dict.fromkeys(row.backend for row in rows))
    columns = [
        Column("", "<"),
        *(Column(name, spec=ERROR, least=12, missing="out of range") for name in backends),
    ]
    lines = [
        f"{RATE_DEG_S:g} deg/s on all three axes, {duration} s, a gyro sample every {sample} s",
        "largest drift in deg",
    ]
    for motion in dict.fromkeys(row.motion for row in rows):
        here = [row for row in rows if row.motion == motion]
        steepest = max((row.pitch_deg for row in here if row.pitch_deg is not None), default=math.nan)
        drifts = {(row.algorithm, row.backend): row.drift_deg for row in here}
        cells = [
            [name, *(drifts[name, backend] for backend in backends)]
            for name in dict.fromkeys(row.algorithm for row in here)
        ]
        lines += ["", f"{motion}; pitch up to {steepest:.2f} deg", *TextTable(columns, cells).lines()]
    return "\n".join(lines)


def rate_table_report(rows: Sequence[Row], duration: str, sample: str) -> Report:
    """Return rows as a report; parameters as for `rate_table_text`."""
    data = [row.as_dict() for row in rows]
    return Report(lambda: rate_table_text(rows, duration, sample), lambda: data, lambda: flat_table(data))
