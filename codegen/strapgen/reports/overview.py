"""The catalogue side by side, as text."""

from __future__ import annotations

import math
from collections.abc import Sequence

import sympy as sp

from strapgen.analysis.overview import _SHORT, CONING_DEG_S, STEP_S, WORK, OverviewRow


def overview_text(rows: Sequence[OverviewRow]) -> str:
    """Return rows as a table for a person."""
    head = [
        "algorithm",
        "order",
        "operations",
        "constant",
        "coning, deg/h",
        "per operation",
        "equal work",
        "contractive",
    ]
    lines = [head]
    for row in rows:
        rate = row.coning_rate()
        lines.append(
            [
                row.kernel,
                "-" if row.order is None else str(row.order),
                str(row.operations),
                _power(row.constant, row.constant_power),
                "-" if rate is None else f"{math.degrees(rate) * 3600:.3e}",
                "-" if row.per_operation is None else f"{row.per_operation:.2e}",
                "-" if row.at_equal_work is None else f"{math.degrees(row.at_equal_work) * 3600:.2e}",
                row.contractive,
            ]
        )
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = [
        "  ".join(
            cell.ljust(width) if k in (0, 3, 7) else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    rates = f"a = b = g = {CONING_DEG_S:g} deg/s"
    notes = [
        "",
        "constant       angle in rad that a step loses at a constant rate, x = |w| h; - none",
        f"coning         leading secular drift rate for {rates}, step {STEP_S:g} s",
        "per operation  that drift of a step in rad, over the operations of the step",
        f"equal work     the drift rate in deg/h where the step is so long that {WORK:g} operations a second do",
        "contractive    angles x of a step at which no state grows; kept: its length is kept exactly",
        "",
        "drift of a step, leading term for the rate w0 + w1 t + w2 t^2/2 + ...",
    ]
    longest = max(len(row.kernel) for row in rows)
    for row in rows:
        terms = len(row.general.replace(" - ", " + ").split(" + "))
        shown = row.general if terms <= _SHORT else f"{terms} terms: strapgen series, or --format json"
        notes.append(f"  {row.kernel:<{longest}}  {shown}")
    return "\n".join([*text, *notes])


def _power(number: sp.Expr | None, power: int | None) -> str:
    if number is None or power is None:
        return "-"
    size = sp.Rational(number) if number.is_Rational else None
    if size is None or size.q > 10**9:
        return f"{float(number):.4g} x^{power}"
    return f"{size} x^{power}"
