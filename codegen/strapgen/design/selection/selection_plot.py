"""Draws the software's drift over what algorithms cost: those that meet a brief, and the cheapest for each drift."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from strapgen.design.frontier.frontier import pareto
from strapgen.design.selection.judgement import SOFTWARE, Judgement
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.design.selection.selection_report import SelectionResult

#: Least drift that is drawn in deg/h, and the part by which a label on the front is better than all that cost less.
_LEAST, _GAIN = 1e-9, 0.2


def selection_image(result: SelectionResult, path: str | Path) -> bytes:
    """Return a picture of judgements: what the software adds to the drift, over its operations a second."""
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
    front = pareto(whole_points, _GAIN)
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
    """Return what is known of the software's drift, 0 before its coning is looked at."""
    if one.drift_deg_h["coning"] is None and one.binding != "truncation":
        return 0.0
    return sum(one.drift_deg_h[cause] or 0.0 for cause in SOFTWARE)
