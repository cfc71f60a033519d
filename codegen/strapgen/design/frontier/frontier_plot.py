"""Plots the drift of attitude algorithms against the multiplications that they take, and the frontier of the best."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.design.frontier.frontier import Standing, pareto
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.design.frontier.frontier_report import FrontierResult

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
_KINDS = {"window": "windows", "coning": "coning coefficients", "": "fits of the rate, integrated"}


def frontier_image(result: FrontierResult, path: str | Path) -> bytes:
    """Return the drift over the multiplications a second: a panel a motion, a point an algorithm.

    A line of steps joins the algorithms that halve the drift of all that cost less; only they have a label.
    """
    standings, sample_hz = result.standings, result.sample_hz
    panels = [label for label in PANELS if label in standings[0].drifts] or list(standings[0].drifts)
    columns = min(_COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure, grid = figures.grid_of_axes(rows, columns, (6.2 * columns, 0.6 + 3.7 * rows))
    labels = [
        (axes, _draw_panel(axes, standings, label, sample_hz))
        for axes, label in zip(grid.flat, panels, strict=True)
    ]
    for axes in grid[-1]:
        axes.set_xlabel("multiplications a second")
    rates = [one.per_second(sample_hz) for one in standings]
    grid[0, 0].set_xlim(min(rates) / _LEFT, max(rates) * _RIGHT)  # of all
    figure.draw_without_rendering()  # axes have their places
    for axes, names in labels:
        figures.labels_beside_points(axes, names, {name: _colour(name) for name in names})
    figures.common_legend(figure, [grid[0, 0]], loc="outside lower center", ncols=len(_KINDS))
    for axes in grid[:, 0]:
        axes.set_ylabel("drift, deg/h")
    title = f"drift over {result.duration_s:g} s at {sample_hz:g} Hz"
    figures.title(figure, f"{title}; a line joins what halves the drift of all that costs less")
    return figures.image(figure, path)


def _draw_panel(
    axes: Any, standings: Sequence[Standing], label: str, sample_hz: float
) -> dict[str, tuple[float, float]]:
    """Draw the algorithms on one motion; return the points on the frontier by their names."""
    points = {
        one.name: (one.per_second(sample_hz), max(value, _LEAST))
        for one in standings
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
