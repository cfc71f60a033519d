"""Stability of steps, as text."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.analysis.growth import Stability


def intervals_text(found: Sequence[tuple[float, float | None]] | None) -> str:
    """Return intervals as text.

    Examples
    --------
    >>> intervals_text([(0.0, 2.8284271)]), intervals_text([]), intervals_text(None)
    ('0 to 2.828', 'nowhere', 'kept')
    """
    if found is None:
        return "kept"
    parts = [f"{low:.4g} up" if high is None else f"{low:.4g} to {high:.4g}" for low, high in found]
    return ", ".join(parts) or "nowhere"


def stability_text(found: Sequence[Stability]) -> str:
    """Return stabilities as a table."""
    width = max(len(one.kernel) for one in found)
    lines = [f"{'step':<{width}}  {'x at which no state grows':<26}  square of the stretch, x = |w| h"]
    for one in found:
        where = intervals_text(one.contractive)
        lines.append(f"{one.kernel:<{width}}  {where:<26}  {sp.sstr(one.stretch_squared)}")
    return "\n".join(lines)
