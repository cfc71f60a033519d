"""Plots; they need the extra `plot`."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from strapgen import output
from strapgen.exceptions import InputError, MissingExtraError
from strapgen.recording import History
from strapgen.reports import AXES, SKEW_PLANES
from strapgen.simulation import Run

_COLOURS = ("#1f5f8b", "#b5562b", "#3d7a4f")


def _pyplot() -> Any:
    try:
        import matplotlib
    except ImportError:
        raise MissingExtraError("plots need matplotlib: pip install 'strapgen[plot]'") from None
    matplotlib.use("Agg")
    import matplotlib.pyplot as pyplot

    return pyplot


def _image(figure: Any, path: str | Path) -> bytes:
    path = Path(path)
    _pyplot().close(figure)  # pyplot lets go of it, it can still be drawn
    kind = path.suffix.lstrip(".").lower()
    allowed = sorted(figure.canvas.get_supported_filetypes())
    if kind not in allowed:
        raise InputError(f"plot {path}: file type {kind!r} is not known; allowed: {', '.join(allowed)}")
    image = io.BytesIO()
    figure.savefig(image, format=kind, dpi=150)
    return image.getvalue()


def _style(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    axes.margins(x=0)
    axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)


def plot_run(run: Run, title: str, path: str | Path) -> Path:
    """Plot the nine errors of a run to a file; see `run_image`."""
    return output.write_file(path, run_image(run, title, path))


def plot_history(history: History, elements: Sequence[str], title: str, path: str | Path) -> Path:
    """Plot an attitude history to a file; see `history_image`."""
    return output.write_file(path, history_image(history, elements, title, path))


def run_image(run: Run, title: str, path: str | Path) -> bytes:
    """Return the nine errors of a run against time: scale, skew and drift, three axes each.

    Parameters
    ----------
    run : Run
    title : str
    path : path
        File for the image; its ending says which kind.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    InputError
        If the kind of image is unknown.
    """
    pyplot = _pyplot()
    figure, grid = pyplot.subplots(3, 3, figsize=(12, 8), sharex=True, layout="constrained")
    parts = (
        ("scale", "", run.scale, AXES),
        ("skew", ", deg", np.degrees(run.skew), SKEW_PLANES),
        ("drift", ", deg", np.degrees(run.drift), AXES),
    )
    for row, (kind, unit, values, names) in enumerate(parts):
        for column, name in enumerate(names):
            axes = grid[row, column]
            axes.plot(run.time, values[:, column], color=_COLOURS[row], linewidth=1.4)
            axes.set_title(f"{name} {kind}{unit}", loc="left", fontsize=10)
            _style(axes)
            if row == 2:
                axes.set_xlabel("time, s")
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=12)
    return _image(figure, path)


def history_image(history: History, elements: Sequence[str], title: str, path: str | Path) -> bytes:
    """Return the elements of an attitude history against time; parameters and errors are those of `run_image`."""
    pyplot = _pyplot()
    states = history.states.reshape(len(history.time), -1)
    columns = 3 if len(elements) == 9 else 1
    rows = -(-len(elements) // columns)
    figure, grid = pyplot.subplots(
        rows,
        columns,
        figsize=(10, 1.9 * rows + 0.6),
        sharex=True,
        sharey=True,
        layout="constrained",
        squeeze=False,
    )
    for axes, name, values in zip(grid.flat, elements, states.T, strict=True):
        axes.plot(history.time, values, color=_COLOURS[0], linewidth=1.2)
        axes.set_title(name, loc="left", fontsize=10)
        _style(axes)
        axes.ticklabel_format(axis="y", style="plain")
        axes.set_ylim(-1.05, 1.05)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figure.suptitle(title.encode(errors="replace").decode(), fontsize=12)
    return _image(figure, path)
