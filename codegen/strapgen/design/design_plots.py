"""Plots of designs: the errors of filters, and the drift of algorithms over their cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.catalogue.methods.window import Window
from strapgen.design.filters import responses
from strapgen.design.frontier import DriftAndCost, pareto
from strapgen.design.selection.judgement import SOFTWARE, Judgement
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.design.frontier import FrontierResult
    from strapgen.design.selection.selection_report import SelectionResult
    from strapgen.design.window_report import WindowResult


#: Frequencies of a curve, and the lowest error that is drawn.
_POINTS, _LOWEST = 240, 1e-14


def window_image(result: WindowResult, path: str | Path) -> bytes:
    """Return the error of each filter against frequency, beside that of the polynomial through the same samples."""
    window = result.window
    curves = {_label(window): window}
    now = [one for one in window.one_sided if one.ahead < window.ahead]
    curves |= {_label(one): one for one in (now[len(now) // 2 :: max(1, len(now) - len(now) // 2 - 1)])}
    fit = replace(window, filters=responses.polynomial_fit(window))
    curves[f"polynomial through {window.total_increments} samples"] = fit
    degrees = range(0 if window.gyro else 1, window.degree + 1)
    figure, grid = figures.grid_of_axes(
        (len(degrees) + 1) // 2, 2, (9.5, 1.4 + 2.5 * ((len(degrees) + 1) // 2))
    )
    points = np.linspace(0.0, np.pi, _POINTS + 1)[1:]
    colours = figures.several_colours(len(curves))
    for axes, m in zip(grid.flat, degrees, strict=False):
        for (label, one), colour in zip(curves.items(), colours, strict=True):
            error = np.maximum(responses.errors(one, m, list(points)), _LOWEST / 10)
            axes.plot(points / (2 * np.pi), error, label=label, color=colour, linewidth=1.4)
        axes.axvline(float(window.band) / (2 * np.pi), color="0.6", linewidth=0.9, zorder=0)
        axes.set_yscale("log")
        axes.set_ylim(_LOWEST, 10.0)
        axes.set_xlim(0.0, 0.5)
        axes.set_title(
            f"F_{m}" if window.partner(m) is None else "F_1 (F_2/30 - F_0/6)", loc="left", fontsize=10
        )
        axes.set_ylabel("error by rate times interval")
        figures.style(axes)
    for axes in grid.flat[len(degrees) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("frequency by the sampling rate")
    figures.common_legend(figure, [grid[0, 0]], loc="outside lower center", ncols=2)
    figures.title(figure, f"{window.name}: errors of the filters, the band marked")
    return figures.image(figure, path)


def _label(window: Window) -> str:
    return f"{window.previous} before, {window.ahead} ahead"


#: The motions of the panels.
PANELS = ("cone 1/10", "cone 1/20", "cone 15/20", "random 200", "slew 50 ms", "ramps 50 ms")
#: Smallest drift that is drawn, in deg/h: what is below is rounding.
_LEAST = 1e-9
_COLUMNS = 2
#: Space at the left of the points, for labels, and at their right, as factors.
_LEFT, _RIGHT = 9.0, 1.5
#: Gain from which an algorithm that costs more is on the frontier: it has half the drift.
_GAIN = 0.5
#: Kinds of algorithms by how their names begin; all others are of the last kind.
_KINDS = {
    ("window", "pair"): "windows",
    ("coning",): "coning coefficients",
    ("",): "fits of the rate, integrated",
}


def frontier_image(result: FrontierResult, path: str | Path) -> bytes:
    """Return the drift over the multiplications a second: a panel a motion, a point an algorithm.

    A line of steps joins the algorithms that halve the drift of all that cost less; only they have a label.
    """
    drifts_and_costs, sample_hz = result.drifts_and_costs, result.sample_hz
    panels = [label for label in PANELS if label in drifts_and_costs[0].drifts] or list(
        drifts_and_costs[0].drifts
    )
    columns = min(_COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure, grid = figures.grid_of_axes(rows, columns, (6.2 * columns, 0.6 + 3.7 * rows))
    labels = [
        (axes, _draw_panel(axes, drifts_and_costs, label, sample_hz))
        for axes, label in zip(grid.flat, panels, strict=True)
    ]
    for axes in grid[-1]:
        axes.set_xlabel("multiplications a second")
    rates = [one.per_second(sample_hz) for one in drifts_and_costs]
    grid[0, 0].set_xlim(min(rates) / _LEFT, max(rates) * _RIGHT)  # of all
    figure.draw_without_rendering()  # axes have their places
    for axes, names in labels:
        figures.labels_beside_points(axes, names, {name: _colour(name) for name in names})
    figures.common_legend(figure, [grid[0, 0]], loc="outside lower center", ncols=len(_KINDS))
    for axes in grid[:, 0]:
        axes.set_ylabel("drift, deg/h")
    title = f"drift over {result.duration_s:g} s at {sample_hz:g} Hz"
    if result.errors:
        title = f"steady {title} on sensors with errors, {Path(result.errors).name}"
    figures.title(figure, f"{title}; a line joins what halves the drift of all that costs less")
    return figures.image(figure, path)


def _draw_panel(
    axes: Any, drifts_and_costs: Sequence[DriftAndCost], label: str, sample_hz: float
) -> dict[str, tuple[float, float]]:
    """Draw the algorithms on one motion; return the points on the frontier by their names."""
    points = {
        one.name: (one.per_second(sample_hz), max(value, _LEAST))
        for one in drifts_and_costs
        if (value := one.drifts[label]) is not None
    }
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_title(_title(label), loc="left", fontsize=10)
    figures.style(axes)
    axes.margins(y=0.15)
    if not points:
        return {}
    front = {name: points[name] for name in pareto(points, _GAIN)}
    axes.plot(*zip(*front.values(), strict=True), drawstyle="steps-post", color="0.55", linewidth=1, zorder=1)
    for kind, colour in zip(_KINDS.values(), figures.COLOURS, strict=True):
        axes.scatter([], [], s=30, color=colour, label=kind)
        for name in (name for name in points if _kind(name) == kind):
            best = name in front
            look = {"s": 30 if best else 14, "alpha": 1.0 if best else 0.4}
            axes.scatter(*points[name], color=colour, linewidths=0, zorder=2, **look)
    return front


def _kind(name: str) -> str:
    """Return the kind of an algorithm."""
    return next(kind for start, kind in _KINDS.items() if name.startswith(start))


def _colour(name: str) -> str:
    """Return the colour of an algorithm."""
    return figures.COLOURS[[*_KINDS.values()].index(_kind(name))]


def _title(label: str) -> str:
    """Return the label of a motion in words; what a user names stays as it is."""
    if label not in PANELS:
        return figures.printable(label)
    kind, _, rest = label.partition(" ")
    if kind == "cone":
        angle, _, frequency = rest.partition("/")
        return f"cone of {angle} deg at {frequency} Hz"
    return {
        "random": f"random rate of {rest} deg/s",
        "slew": f"slews of 300 deg/s, onset of {rest}",
        "ramps": f"slews of 300 deg/s, ramps of {rest}",
    }[kind]


#: Gain from which an algorithm that costs more has a label.
_LABEL_GAIN = 0.2


def selection_image(result: SelectionResult, path: str | Path) -> bytes:
    """Return a plot of judgements: the drift due to software over its operations a second."""
    brief, ordered = result.brief, result.ordered
    figure, grid = figures.grid_of_axes(1, 1, (9.0, 5.4))
    axes = grid[0, 0]
    axes.set_xscale("log")
    axes.set_yscale("log")
    figures.style(axes)
    drawn = [one for one in ordered if _drift(one) > 0]
    points = {one.name: (one.operations_per_s, max(_LEAST, _drift(one))) for one in drawn}
    kinds = {
        "meets the brief": [one for one in drawn if one.meets],
        "exceeds the software's share": [one for one in drawn if one.binding in SOFTWARE],
        "exceeds another limit": [one for one in drawn if not one.meets and one.binding not in SOFTWARE],
    }
    for (kind, several), colour in zip(
        kinds.items(), (figures.COLOURS[2], *figures.COLOURS[1::-1]), strict=True
    ):
        size = 34 if kind == "meets the brief" else 16
        whole = [points[one.name] for one in several if _is_whole(one)]
        part = [points[one.name] for one in several if not _is_whole(one)]
        axes.scatter(*zip(*whole, strict=True) if whole else ([], []), s=size, color=colour, label=kind)
        if part:  # what is not looked at would add to the drift
            axes.scatter(*zip(*part, strict=True), s=size, facecolors="none", edgecolors=colour)
    share = brief.budget.drift_deg_h * brief.budget.software_share
    axes.axhline(share, color="0.4", linewidth=1, linestyle="--")
    axes.annotate(
        f"software's share, {share:.2g} deg/h",
        (0.99, share),
        xycoords=("axes fraction", "data"),
        xytext=(0, 4),
        textcoords="offset points",
        ha="right",
        fontsize=8,
        color="0.3",
    )
    if brief.processor.operations_per_s is not None:
        axes.axvline(brief.processor.operations_per_s, color="0.4", linewidth=1, linestyle="--")
    whole_points = {one.name: points[one.name] for one in drawn if _is_whole(one)}
    front = pareto(whole_points, _LABEL_GAIN)
    if front:
        steps = [whole_points[name] for name in front]
        axes.plot(*zip(*steps, strict=True), drawstyle="steps-post", color="0.55", linewidth=1, zorder=1)
    axes.margins(0.12)
    axes.set_xlabel("operations a second")
    axes.set_ylabel("truncation, coning and rounding, deg/h")
    figure.draw_without_rendering()
    figures.labels_beside_points(
        axes, {name: whole_points[name] for name in front}, dict.fromkeys(front, "0.1")
    )
    figures.common_legend(figure, [axes], loc="outside lower center", ncols=3)
    words = "what the software adds to the drift, and what it costs; hollow: rounding is not looked at"
    figures.title(figure, f"{result.name}: {words}")
    return figures.image(figure, path)


def _is_whole(one: Judgement) -> bool:
    """Return whether all of the software's causes are known."""
    return all(one.drift_deg_h[cause] is not None for cause in SOFTWARE)


def _drift(one: Judgement) -> float:
    """Return the known part of the software's drift, 0 before its coning is computed."""
    if one.drift_deg_h["coning"] is None and one.binding != "truncation":
        return 0.0
    return sum(one.drift_deg_h[cause] or 0.0 for cause in SOFTWARE)
