"""Reports the stability of steps."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.analysis.growth.growth import Stability
from strapgen.analysis.series.notation import intervals_text
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_COLUMNS = (
    Column("step", "<"),
    Column("x at which no state grows", "<", least=26),
    Column("square of the stretch, x = |w| h", "<"),
)


def stability_latex(stabilities: Sequence[Stability]) -> str:
    r"""Return the squares of the stretches \rho of steps as functions of the angle x of a step in rad."""
    return equations(
        (rf"\rho_{{\mathrm{{{one.kernel}}}}}^{{2}}", expression_latex(one.stretch_squared))
        for one in stabilities
    )


def stability_text(stabilities: Sequence[Stability]) -> str:
    """Return stabilities as a table."""
    return _table(stabilities).as_text()


def stability_report(stabilities: Sequence[Stability]) -> Report:
    """Return stabilities as a report."""
    return Report(
        lambda: stability_text(stabilities),
        lambda: [one.as_dict() for one in stabilities],
        lambda: _table(stabilities),
        latex=lambda: stability_latex(stabilities),
    )


def _table(stabilities: Sequence[Stability]) -> TextTable:
    rows = [
        (one.kernel, intervals_text(one.contractive), sp.sstr(one.stretch_squared)) for one in stabilities
    ]
    return TextTable(_COLUMNS, rows)
