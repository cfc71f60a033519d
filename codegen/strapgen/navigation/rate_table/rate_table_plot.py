"""Plots the drift of the rate-table test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen.navigation.rate_table.rate_table import RATE_DEG_S, TWO_SPEED, Row
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.navigation.rate_table.rate_table_report import RateTableResult

_MARKERS = "osD^vP*X"
#: An angle that is marked: one second of arc.
_ARCSECOND_DEG = 1 / 3600


def rate_table_image(result: RateTableResult, path: str | Path) -> bytes:
    """Return the largest drift of every algorithm: a panel for each motion, a line an algorithm, a mark a back end."""
    rows, duration, sample = result.drifts, result.duration, result.sample
    motions = list(dict.fromkeys(row.motion for row in rows))
    algorithms = list(dict.fromkeys(row.algorithm for row in rows))
    backends = list(dict.fromkeys(row.backend for row in rows))
    size = (3.0 + 4.6 * len(motions), 1.7 + 0.27 * len(algorithms))
    figure, grid = figures.grid_of_axes(1, len(motions), size, sharey=True)
    for axes, motion in zip(grid[0], motions, strict=True):
        here = [row for row in rows if row.motion == motion]
        _draw_motion(axes, here, algorithms, backends)
        steepest = max((row.pitch_deg for row in here if row.pitch_deg is not None), default=math.nan)
        axes.set_title(f"{motion}; pitch up to {steepest:.1f} deg", loc="left", fontsize=10)
        axes.set_xlabel("largest drift of the run, deg")
    grid[0, 0].set_yticks(range(len(algorithms)), algorithms, fontsize=9)
    grid[0, 0].set_ylim(len(algorithms) - 0.4, -0.6)
    figures.common_legend(figure, grid[0], loc="outside lower center", ncols=min(6, len(backends)))
    figures.title(
        figure,
        f"rate table at {RATE_DEG_S:g} deg/s on all three axes, {duration} s, a gyro sample every {sample} s",
    )
    return figures.image(figure, path)


def _draw_motion(axes: Any, rows: Sequence[Row], algorithms: Sequence[str], backends: Sequence[str]) -> None:
    """Draw the drifts of one motion, with a thin line where another attitude representation begins."""
    for number, (backend, colour) in enumerate(
        zip(backends, figures.several_colours(len(backends)), strict=True)
    ):
        drifts = {row.algorithm: row.drift_deg for row in rows if row.backend == backend}
        axes.plot(
            [drifts.get(name) or math.nan for name in algorithms],
            range(len(algorithms)),
            linestyle="none",
            marker=_MARKERS[number % len(_MARKERS)],
            markersize=9.5 - 1.1 * min(number, 5),  # equal drifts: one mark inside the other
            markerfacecolor="none",
            markeredgewidth=1.5,
            color=colour,
            label=backend,
        )
    if any(row.drift_deg for row in rows):
        axes.set_xscale("log")
    figures.style(axes)
    for place, name in enumerate(algorithms):
        lost = [row.backend for row in rows if row.algorithm == name and row.drift_deg is None]
        if lost:
            axes.text(
                0.02,
                place,
                f"out of range: {', '.join(lost)}",
                transform=axes.get_yaxis_transform(),
                fontsize=8,
                color="0.35",
                va="center",
            )
    low, high = axes.get_xlim()
    if low < _ARCSECOND_DEG < high:
        axes.axvline(_ARCSECOND_DEG, color="0.55", linewidth=0.9, linestyle="--", zorder=0)
        axes.annotate(
            "1\u2033",
            (_ARCSECOND_DEG, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3, -9),
            textcoords="offset points",
            fontsize=9,
            color="0.4",
        )
    families = [
        name.rpartition(" ")[2] if name.endswith(TWO_SPEED) else name.split("-")[0] for name in algorithms
    ]
    for place in range(1, len(families)):
        if families[place] != families[place - 1]:
            axes.axhline(place - 0.5, color="0.7", linewidth=0.8, zorder=0)
