"""Plots errors under vibration against frequency."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.results import figures
from strapgen.results.table import READABLE_UNITS

if TYPE_CHECKING:
    from strapgen.analysis.vibration.curves import Curve
    from strapgen.analysis.vibration.vibration_report import VibrationResult

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
