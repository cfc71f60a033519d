"""Plots predicted and simulated drift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.analysis.agreement.agreement import Agreement, StepAgreement
    from strapgen.analysis.error_analysis.series_report import SeriesResult


def agreement_image(result: SeriesResult, path: str | Path) -> bytes:
    """Return predicted against simulated drift: over time at the longest step, and their difference by step length."""
    agreements = result.agreements
    figure, (left, right) = figures.pyplot().subplots(1, 2, figsize=(11.5, 4.8), layout="constrained")
    _draw_over_time(left, agreements[-1].rungs[0])
    _draw_against_step(right, agreements)
    figures.title(figure, result.plot_title)
    return figures.image(figure, path)


def _draw_over_time(axes: Any, rung: StepAgreement) -> None:
    """Draw predicted and simulated drift over time, at one step."""
    for axis, colour in enumerate(figures.COLOURS):
        axes.plot(rung.times, [row[axis] for row in rung.predicted], color=colour)
        axes.plot(
            rung.times,
            [row[axis] for row in rung.simulated],
            linestyle="none",
            marker="o",
            markersize=4.5,
            markerfacecolor="white",
            color=colour,
        )
    figures.style_over_time(axes)
    axes.set_xlabel("time, s")
    axes.set_ylabel("drift, rad")
    title = f"step {figures.fraction(rung.step_s)} s; lines predicted, circles simulated"
    axes.set_title(title, loc="left", fontsize=10)
    ends = zip(rung.simulated[-1], "xyz", figures.COLOURS, strict=True)
    figures.labels_at_the_right(axes, [(float(end), name, colour) for end, name, colour in ends])


def _draw_against_step(axes: Any, agreements: Sequence[Agreement]) -> None:
    """Draw the simulated drift against the step, and what is left of it after each prediction."""
    rungs = agreements[0].rungs
    steps = [rung.step_s for rung in rungs]
    drifts = [rung.drift or math.nan for rung in rungs]
    axes.plot(steps, drifts, color="0.35", marker="o", markersize=4.5)
    labels = [(max(zip(steps, drifts, strict=True))[1], "simulated drift", "0.35")]
    for one, colour in zip(agreements, figures.COLOURS, strict=False):
        differences = [rung.difference or math.nan for rung in one.rungs]
        terms = "the leading term" if one.terms == 1 else f"{one.terms} powers of h"
        slope = f": slope {one.slopes[-1]:.2f}" if one.slopes else ""
        axes.plot(steps, differences, color=colour, marker="s", markersize=4.5)
        end = max(zip(steps, differences, strict=True))[1]
        labels.append((end, f"less {terms}{slope}", colour))
    if any(value > 0 for value in drifts):
        axes.set_yscale("log")
    figures.step_ticks(axes, steps)
    axes.set_ylabel("largest over the run, rad")
    figures.style(axes)
    axes.set_title("what the prediction leaves", loc="left", fontsize=10)
    figures.labels_at_the_right(axes, [label for label in labels if not math.isnan(label[0])])
