"""Plots the errors of a run, an attitude history, and a course with velocities, against time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.recordings.recording import History
from strapgen.lab.simulate.runs import Run
from strapgen.lab.simulate.runs_report import AXES, SKEW_PLANES
from strapgen.results import figures
from strapgen.storage.files import write_file

if TYPE_CHECKING:
    pass


def plot_run(run: Run, title: str, path: str | Path) -> Path:
    """Plot the nine errors of a run to a file; see `run_image`."""
    return write_file(path, run_image(run, title, path))


def plot_history(history: History, elements: Sequence[str], title: str, path: str | Path) -> Path:
    """Plot an attitude history to a file; see `history_image`."""
    return write_file(path, history_image(history, elements, title, path))


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


def run_image(run: Run, title: str, path: str | Path) -> bytes:
    """Return the nine errors of a run against time: scale, skew and drift, three axes each."""
    return figures.image(run_figure(run, title), path)


def history_image(history: History, elements: Sequence[str], title: str, path: str | Path) -> bytes:
    """Return the elements of an attitude history against time; parameters and errors are those of `run_image`."""
    return figures.image(history_figure(history, elements, title), path)


def history_figure(history: History, elements: Sequence[str], title: str) -> Any:
    """Return the figure of `history_image`."""
    states = history.states.reshape(len(history.time), -1)
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
