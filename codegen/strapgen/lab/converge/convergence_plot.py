"""Plots the error of runs against the step, beside the slope that theory predicts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.converge.convergence import labels
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.lab.converge.convergence import Convergence
    from strapgen.lab.converge.convergence_report import ConvergenceResult


def convergence_image(result: ConvergenceResult, path: str | Path) -> bytes:
    """Return error against step, a line an algorithm, beside a line of the slope that theory says."""
    outcomes = result.outcomes
    figure, grid = figures.grid_of_axes(1, 1, (9.5, 5.6))
    axes = grid[0, 0]
    colours = figures.colours(len(outcomes), figures.LIGHTEST)
    for number, outcome in enumerate(outcomes):
        _draw_algorithm(axes, outcome, colours[number], "osD^v<>p"[number % 8])
    rungs = [rung for outcome in outcomes for rung in outcome.rungs]
    if any(rung.error_rad for rung in rungs):  # else all are exact: nothing to draw
        axes.set_yscale("log")
        axes.set_ylim(top=10)
    figures.step_ticks(axes, sorted({rung.step_s for rung in rungs}))
    axes.set_ylabel("largest error, rad")
    figures.style(axes)
    figures.labels_at_the_right(
        axes, [label for label in map(_label, outcomes, labels(outcomes), colours) if label is not None]
    )
    axes.set_title("slope of the filled points; dashed: theory", loc="left", fontsize=9, color="0.35")
    figures.title(figure, result.title)
    return figures.image(figure, path)


def _label(outcome: Convergence, name: str, colour: Any) -> tuple[float, str, Any] | None:
    """Return what stands at the right end of a line: the name, the observed order and that of theory."""
    errors = [(rung.step_s, rung.error_rad) for rung in outcome.rungs if rung.error_rad]
    if not errors:
        return None
    slope = "order hidden" if outcome.observed is None else f"{outcome.observed:.2f}"
    theory = "" if outcome.predicted is None else f", theory {outcome.predicted}"
    return max(errors)[1], f"{name}: {slope}{theory}", colour


def _draw_algorithm(axes: Any, outcome: Convergence, colour: Any, marker: str) -> None:
    """Draw the errors of one algorithm, filled where the slope is fitted, and the predicted slope dashed."""
    rungs = [rung for rung in outcome.rungs if rung.error_rad]
    steps = [rung.step_s for rung in rungs]
    axes.plot(steps, [rung.error_rad for rung in rungs], color=colour, linewidth=1.2, alpha=0.6)
    for used in (True, False):
        points = [rung for rung in rungs if rung.used is used]
        axes.plot(
            [rung.step_s for rung in points],
            [rung.error_rad for rung in points],
            linestyle="none",
            marker=marker,
            markersize=5.5,
            color=colour,
            markerfacecolor=colour if used else "white",
        )
    fitted = [rung for rung in rungs if rung.used]
    if outcome.predicted is not None and fitted:
        anchor = fitted[-1]
        wide = np.array([anchor.step_s, max(steps)])
        line = (anchor.error_rad or 0.0) * (wide / anchor.step_s) ** outcome.predicted
        axes.plot(wide, line, color=colour, linewidth=0.9, linestyle="--")
