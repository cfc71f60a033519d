"""Plots the errors of a run, an attitude history, and a course with velocities, against time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.recordings.recording import History
from strapgen.lab.simulate.runs import Run
from strapgen.lab.simulate.runs_report import AXES, SKEW_PLANES, history_elements
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.lab.simulate.runs_report import HistoryResult, RunResult


def run_figure(run: Run, title: str) -> Any:
    """Return the figure of `run_image`."""
    figure, grid = figures.grid_of_axes(3, 3, (12, 8))
    parts = (
        ("scale", "", run.scale, AXES),
        ("skew", ", deg", np.degrees(run.skew), SKEW_PLANES),
        ("drift", ", deg", np.degrees(run.drift), AXES),
    )
    for row, (kind, unit, values, names) in enumerate(parts):
        for column, name in enumerate(names):
            axes = grid[row, column]
            axes.plot(run.time, values[:, column], color=figures.COLOURS[row], linewidth=1.4)
            axes.set_title(f"{name} {kind}{unit}", loc="left", fontsize=10)
            figures.style_over_time(axes)
            if row == 2:
                axes.set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure


def run_image(result: RunResult, path: str | Path) -> bytes:
    """Return the nine errors of a run against time: scale, skew and drift, three axes each."""
    return figures.image(run_figure(result.run, result.title or result.plot_title), path)


def history_image(result: HistoryResult, path: str | Path) -> bytes:
    """Return the elements of an attitude history against time."""
    return figures.image(history_figure(result.history, result.title or result.plot_title), path)


def history_figure(history: History, title: str) -> Any:
    """Return the figure of `history_image`."""
    states, elements = history.states.reshape(len(history.time), -1), history_elements(history)
    columns = 3 if len(elements) == 9 else 1
    rows = -(-len(elements) // columns)
    figure, grid = figures.grid_of_axes(rows, columns, (10, 1.9 * rows + 0.6), sharey=True)
    for axes, name, values in zip(grid.flat, elements, states.T, strict=True):
        axes.plot(history.time, values, color=figures.COLOURS[0], linewidth=1.2)
        axes.set_title(name, loc="left", fontsize=10)
        figures.style_over_time(axes)
        axes.ticklabel_format(axis="y", style="plain")
        axes.set_ylim(-1.05, 1.05)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure
