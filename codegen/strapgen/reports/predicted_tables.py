"""The thesis's tables from the series, as text."""

from __future__ import annotations

from collections.abc import Sequence

from strapgen.experiments.predicted_tables import PredictedEntry
from strapgen.experiments.thesis_tables import (
    TABLES,
)


def predicted_text(found: Sequence[PredictedEntry]) -> str:
    """Return predicted tables as text."""
    lines = []
    for table in TABLES:
        rows = [entry for entry in found if entry.table == table.number]
        if not rows:
            continue
        ratio = "of the same order" if table.by_order else "of first order"
        lines += [
            f"Table {table.number}: {table.title}",
            f"  drift in deg, and its ratio to that of direction cosines {ratio}",
            f"  {'':<20}{'predicted':>11}{'simulated':>11}{'ratio':>12}{'simulated':>11}{'off by':>9}{'thesis':>10}",
        ]
        for row in rows:
            name = f"{row.algorithm}, order {row.order}"
            mark = "" if row.agrees else " *"
            lines.append(
                f"  {name:<20}{row.drift_deg:>11.4g}{row.simulated_deg:>11.4g}{row.normalised:>12.4g}"
                f"{row.simulated:>11.4g}{row.deviation:>+9.2%}{row.thesis:>10}{mark}"
            )
        lines.append("")
    if not all(entry.agrees for entry in found):
        lines.append("* not the thesis's figure in its printed digits\n")
    return "\n".join(lines)
