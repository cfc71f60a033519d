"""The rate-table test as a result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.navigation.rate_table.rate_table import RATE_DEG_S, Row
from strapgen.results.result import Result
from strapgen.results.table import ERROR, Column, TextTable


@dataclass(frozen=True)
class RateTableResult(Result):
    """The largest drift of the rate-table test: a row for each motion, algorithm and back end."""

    rows_in = "drifts"
    row = Row
    drawn_by = "strapgen.navigation.rate_table.rate_table_plot:rate_table_image"

    drifts: Sequence[Row]
    #: Duration of the test, and time between gyro samples, in s
    duration: str
    sample: str

    def text(self) -> str:
        """Return a table for each motion: a line an algorithm, a column a back end."""
        rows = self.drifts
        backends = list(dict.fromkeys(row.backend for row in rows))
        columns = [
            Column("", "<"),
            *(Column(name, spec=ERROR, least=12, missing="out of range") for name in backends),
        ]
        lines = [
            f"{RATE_DEG_S:g} deg/s on all three axes, {self.duration} s, a gyro sample every {self.sample} s",
            "largest drift in deg",
        ]
        for motion in dict.fromkeys(row.motion for row in rows):
            here = [row for row in rows if row.motion == motion]
            steepest = max((row.pitch_deg for row in here if row.pitch_deg is not None), default=math.nan)
            drift_of = {(row.algorithm, row.backend): row.drift_deg for row in here}
            cells = [
                [name, *(drift_of[name, backend] for backend in backends)]
                for name in dict.fromkeys(row.algorithm for row in here)
            ]
            lines += ["", f"{motion}; pitch up to {steepest:.2f} deg", *TextTable(columns, cells).lines()]
        return "\n".join(lines)
