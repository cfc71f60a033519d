"""Reports predicted beside simulated drift as text."""

from __future__ import annotations

from strapgen.analysis.agreement.agreement import Agreement
from strapgen.results.table import SECONDS, Column, TextTable

_COLUMNS = (
    Column("step, s", spec=SECONDS, least=12),
    Column("simulated", spec=".4e", least=12),
    Column("difference", spec=".4e", least=12),
    Column("relative", spec=".1e", least=9),
    Column("slope", "<", ".2f", missing=""),
)


def agreement_text(agreement: Agreement) -> str:
    """Return the agreement as a table: a row for every step length."""
    slopes: list[float | None] = [None, *agreement.slopes]
    slopes += [None] * (len(agreement.rungs) - len(slopes))
    rows = [
        (
            rung.step_s,
            rung.drift,
            rung.difference,
            rung.difference / rung.drift if rung.drift else None,
            slope,
        )
        for rung, slope in zip(agreement.rungs, slopes, strict=True)
    ]
    title = (
        f"{agreement.kernel}, {agreement.motion} motion: drift in rad, "
        f"simulated and predicted by {agreement.terms} terms"
    )
    return f"{title}\n{TextTable(_COLUMNS, rows).as_text()}"
