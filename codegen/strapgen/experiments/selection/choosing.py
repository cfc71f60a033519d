"""Returns the algorithm behind a name: an attitude step, or the loops of two speeds."""

from __future__ import annotations

from pathlib import Path

from strapgen.experiments.selection.algorithm import Algorithm, AttitudeStep
from strapgen.experiments.selection.brief import DesignBrief
from strapgen.experiments.selection.candidates import TWO_SPEED, Contender
from strapgen.experiments.selection.two_speed import TwoSpeedLoops


def algorithm_of(contender: Contender, state: str, brief: DesignBrief, path: str | Path) -> Algorithm:
    """Return an algorithm for a brief.

    Parameters
    ----------
    contender : Contender
    state : str
        A name of `candidates.STATES`.
    brief : DesignBrief
    path : path
        The file of the brief, for which coefficients are designed.

    Raises
    ------
    InputError
        If the state has no such step.
    """
    if contender.method == TWO_SPEED:
        return TwoSpeedLoops(state, contender.increments, brief)
    return AttitudeStep(contender.choice(state, str(path)), brief)
