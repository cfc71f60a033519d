"""Plots the growth of a state in a step, and the steps at which it does not grow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.analysis.growth.growth import Stability
    from strapgen.analysis.growth.growth_report import StabilityResult


def stability_image(result: StabilityResult, path: str | Path) -> bytes:
    """Return the growth of a state at a constant rate against the angle of a step; below, where the step contracts."""
    stabilities = result.steps
    ends = [end for one in stabilities for pair in one.contractive or () for end in pair if end is not None]
    reach = 1.15 * max([*ends, 2.0])
    below = 0.28 * len(stabilities)
    figure, grid = figures.grid_of_axes(2, 1, (9.5, 4.6 + below), height_ratios=(4.0, 0.4 + below))
    curves, bars = grid[:, 0]
    angles = np.linspace(0.0, reach, 600)
    for number, (one, colour) in enumerate(
        zip(stabilities, figures.colours(len(stabilities), figures.LIGHTEST), strict=True)
    ):
        curves.plot(angles, one.stretch(angles), color=colour, linewidth=1.5, label=one.kernel)
        _draw_intervals(bars, one, len(stabilities) - 1 - number, reach, colour)
    curves.axhline(1.0, color="0.35", linewidth=0.9)
    curves.axhspan(0.0, 1.0, color="0.5", alpha=0.08, linewidth=0)
    curves.set_ylim(0.0, 2.0)
    curves.set_ylabel("length of the state after a step")
    curves.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.02))
    bars.set_yticks(range(len(stabilities)), [one.kernel for one in reversed(stabilities)], fontsize=9)
    bars.set_ylim(-0.6, len(stabilities) - 0.4)
    bars.set_title("where no state grows", loc="left", fontsize=10)
    bars.set_xlabel("angle of a step |w| h, rad")
    bars.set_xlim(0.0, reach)
    figures.style(curves)
    figures.style(bars, grid="x")
    figures.title(figure, "constant rate: growth of the state in a step, and where it contracts")
    return figures.image(figure, path)


def _draw_intervals(bars: Any, stability: Stability, place: int, reach: float, colour: Any) -> None:
    """Draw the angles at which no state grows, as far as the picture reaches."""
    preserved = stability.contractive is None
    for low, high in [(0.0, None)] if preserved else stability.contractive or ():
        wide = (reach if high is None else high) - low
        bars.barh(place, wide, left=low, height=0.55, color=colour, alpha=0.35 if preserved else 0.9)
    if preserved:
        bars.text(0.01 * reach, place, "length kept", va="center", fontsize=8, color="0.2")
    elif not stability.contractive:
        bars.text(0.01 * reach, place, "nowhere", va="center", fontsize=8, color="0.35")
