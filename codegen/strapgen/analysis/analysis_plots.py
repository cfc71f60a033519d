"""Plots of analyses: growth of a state, predicted beside simulated drift, and errors under vibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.results import figures
from strapgen.results.table import READABLE_UNITS

if TYPE_CHECKING:
    from strapgen.analysis.error_analysis import SeriesResult
    from strapgen.analysis.growth import Stability, StabilityResult
    from strapgen.analysis.series.prediction import Agreement, StepAgreement
    from strapgen.analysis.vibration.mean_rates import Curve
    from strapgen.analysis.vibration.vibration_report import VibrationResult


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
    """Draw the simulated drift against the step, and its residual after each prediction."""
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


#: The mean rate of each unit that is drawn.
_RATES = {"rad/s": "mean drift", "m/s^2": "mean acceleration"}
#: The lowest error that is drawn, as a part of the highest true rate.
_LOWEST = 1e-9
_COLOURS = figures.several_colours(8)
_LINES = ("-", (0, (5, 2)), (0, (1, 1.5)))


def vibration_image(result: VibrationResult, path: str | Path) -> bytes:
    """Return the errors of algorithms under vibration against frequency: drift in deg/h, acceleration in micro-g.

    Curves in rad/s and those in m/s^2 have a panel each.
    """
    curves, mark_hz = result.curves, result.marked_hz
    panels = {unit: [(label, curve) for label, curve in curves if curve.unit == unit] for unit in _RATES}
    panels = {unit: group for unit, group in panels.items() if group}
    size = (8.5, 1.0 + 3.4 * len(panels) + 0.11 * len(curves))
    figure, grid = figures.grid_of_axes(len(panels), 1, size)
    labels = list(dict.fromkeys(label for label, _ in curves))
    for axes, (unit, group) in zip(grid[:, 0], panels.items(), strict=True):
        _draw_panel(axes, unit, group, labels)
        if mark_hz and group[0][1].frequencies_hz[0] <= mark_hz <= group[0][1].frequencies_hz[-1]:
            _mark(axes, mark_hz)
    grid[-1, 0].set_xlabel("frequency, Hz")
    figures.common_legend(figure, grid[:, 0], loc="outside lower center", ncols=2)
    figures.title(figure, result.plot_title)
    return figures.image(figure, path)


def _draw_panel(axes: Any, unit: str, group: Sequence[tuple[str, Curve]], labels: Sequence[str]) -> None:
    """Draw the true rate, and the error of each algorithm in the line of its label."""
    readable, factor = READABLE_UNITS[unit]
    hertz, true = group[0][1].frequencies_hz, np.abs(group[0][1].continuous) * factor
    axes.plot(hertz, true, color="0.45", linewidth=1.3, linestyle="--", label="true rate")
    for label, curve in group:
        place = labels.index(label)
        axes.plot(
            curve.frequencies_hz,
            np.abs(curve.error) * factor,
            color=_COLOURS[place % len(_COLOURS)],
            linestyle=_LINES[place // len(_COLOURS) % len(_LINES)],
            linewidth=3.0 - 1.8 * place / max(1, len(labels) - 1),  # equal errors: one line inside the other
            label=f"error of {label}",
        )
    axes.set_xscale("log")
    if np.any(true):
        axes.set_yscale("log")
        highest = float(true.max())
        lowest = min(float(np.min(np.abs(curve.error[curve.error != 0]), initial=1.0)) for _, curve in group)
        axes.set_ylim(max(lowest * factor / 3, highest * _LOWEST), highest * 8)
    axes.set_ylabel(f"{_RATES[unit]}, {readable}")
    axes.set_xlim(hertz[0], hertz[-1])
    figures.style(axes)


def _mark(axes: Any, hertz: float) -> None:
    """Mark a frequency."""
    axes.axvline(hertz, color="0.6", linewidth=0.9, zorder=0)
    axes.annotate(
        f"{hertz:g} Hz",
        (hertz, 0.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, 5),
        textcoords="offset points",
        fontsize=8.5,
        color="0.4",
    )
