"""Returns the algorithm behind a name: an attitude step, or the loops of two speeds."""

from __future__ import annotations

from pathlib import Path

from strapgen import registration
from strapgen.design.brief import DesignBrief
from strapgen.design.selection.algorithm import Algorithm, AttitudeStep
from strapgen.design.selection.candidates import TWO_SPEED, Contender


def algorithm_of(contender: Contender, state: str, brief: DesignBrief, path: str | Path) -> Algorithm:
    """Return an algorithm for a brief."""
    if contender.method == TWO_SPEED:
        loops: Algorithm = registration.extension("design.two-speed", f"method {TWO_SPEED}")(
            state, contender.increments, brief
        )
        return loops
    return AttitudeStep(contender.choice(state, str(path)), brief)
