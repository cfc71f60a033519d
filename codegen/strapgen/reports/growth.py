"""Stability of steps, as text."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.analysis.growth import Stability, intervals_text


def stability_text(found: Sequence[Stability]) -> str:
    """Return stabilities as a table."""
    width = max(len(one.kernel) for one in found)
    lines = [f"{'step':<{width}}  {'x at which no state grows':<26}  square of the stretch, x = |w| h"]
    for one in found:
        where = intervals_text(one.contractive)
        lines.append(f"{one.kernel:<{width}}  {where:<26}  {sp.sstr(one.stretch_squared)}")
    return "\n".join(lines)
