"""Reports the stability of steps as text."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.analysis.growth import Stability
from strapgen.analysis.notation import intervals_text
from strapgen.reports.table import Column, TextTable

_COLUMNS = (
    Column("step", "<"),
    Column("x at which no state grows", "<", least=26),
    Column("square of the stretch, x = |w| h", "<"),
)


def stability_text(stabilities: Sequence[Stability]) -> str:
    """Return stabilities as a table."""
    rows = [
        (one.kernel, intervals_text(one.contractive), sp.sstr(one.stretch_squared)) for one in stabilities
    ]
    return TextTable(_COLUMNS, rows).as_text()
