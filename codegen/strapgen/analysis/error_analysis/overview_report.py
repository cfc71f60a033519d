"""Reports the overview of the catalogue, with one row for each algorithm and method."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import sympy as sp

from strapgen.analysis.error_analysis.overview import CONING_DEG_S, STEP_S, WORK, OverviewRow
from strapgen.results.report import Report, flat_table
from strapgen.results.table import ERROR, Column, TextTable

#: Most terms of a vector that are written out.
_MOST_TERMS = 3
_COLUMNS = (
    Column("algorithm", "<"),
    Column("order"),
    Column("operations"),
    Column("constant", "<"),
    Column("coning, deg/h", spec=ERROR),
    Column("per operation", spec=".2e"),
    Column("equal work", spec=".2e"),
    Column("contractive", "<"),
)
_NOTES = (
    "constant       angle in rad that a step loses at a constant rate, x = |w| h; - none",
    f"coning         leading secular drift rate for a = b = g = {CONING_DEG_S:g} deg/s, step {STEP_S:g} s",
    "per operation  that drift of a step in rad, over the operations of the step",
    f"equal work     the drift rate in deg/h where the step is so long that {WORK:g} operations a second do",
    "contractive    angles x of a step at which no state grows; kept: its length is kept exactly",
)


def overview_text(rows: Sequence[OverviewRow]) -> str:
    """Return rows as text: a table, what its columns mean, and the drift of a step of each algorithm."""
    drifts = [(row.kernel, _general(row)) for row in rows]
    return "\n".join(
        [
            *_table(rows).lines(),
            "",
            *_NOTES,
            "",
            "drift of a step, leading term for the rate w0 + w1 t + w2 t^2/2 + ...",
            *TextTable([Column(align="<")] * 2, drifts).lines("  "),
        ]
    )


def overview_report(rows: Sequence[OverviewRow]) -> Report:
    """Return rows as a report."""
    data = [row.as_dict() for row in rows]
    return Report(lambda: overview_text(rows), lambda: data, lambda: flat_table(data), lambda: _table(rows))


def _table(rows: Sequence[OverviewRow]) -> TextTable:
    return TextTable(_COLUMNS, [_cells(row) for row in rows])


def _cells(row: OverviewRow) -> list[Any]:
    return [
        row.kernel,
        row.order,
        row.operations,
        _power(row.constant, row.constant_power),
        _deg_h(row.coning_rate()),
        row.per_operation,
        _deg_h(row.at_equal_work),
        row.contractive,
    ]


def _deg_h(rate: float | None) -> float | None:
    """Return a rate in rad/s in deg/h."""
    return None if rate is None else math.degrees(rate) * 3600


def _general(row: OverviewRow) -> str:
    terms = len(row.general.replace(" - ", " + ").split(" + "))
    return row.general if terms <= _MOST_TERMS else f"{terms} terms: strapgen series, or --format json"


def _power(number: sp.Expr | None, power: int | None) -> str | None:
    if number is None or power is None:
        return None
    size = sp.Rational(number) if number.is_Rational else None
    if size is None or size.q > 10**9:
        return f"{float(number):.4g} x^{power}"
    return f"{size} x^{power}"
