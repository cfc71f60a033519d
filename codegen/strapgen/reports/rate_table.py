"""The rate-table test as text."""

from __future__ import annotations

import math
from collections.abc import Sequence

from strapgen.experiments.rate_table import RATE_DEG_S, Row


def rate_table_text(rows: Sequence[Row], duration: str, sample: str) -> str:
    """Return rows as a table: a line an algorithm, a column a back end."""
    backends = list(dict.fromkeys(row.backend for row in rows))
    lines = [
        f"{RATE_DEG_S:g} deg/s on all three axes, {duration} s, a gyro sample every {sample} s",
        "largest drift in deg",
    ]
    for motion in dict.fromkeys(row.motion for row in rows):
        here = [row for row in rows if row.motion == motion]
        steepest = max((row.pitch_deg for row in here if row.pitch_deg is not None), default=math.nan)
        lines += ["", f"{motion}; pitch up to {steepest:.2f} deg"]
        names = list(dict.fromkeys(row.algorithm for row in here))
        width = max(map(len, names))
        lines.append(" " * width + "".join(f"{name:>14}" for name in backends))
        for name in names:
            cells = {row.backend: row.drift_deg for row in here if row.algorithm == name}
            lines.append(
                name.ljust(width)
                + "".join(
                    f"{'out of range' if cells[b] is None else format(cells[b], '.3e'):>14}" for b in backends
                )
            )
    return "\n".join(line.rstrip() for line in lines)
