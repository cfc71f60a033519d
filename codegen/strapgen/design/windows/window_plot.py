"""Plots the errors of a window's filters against frequency."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from strapgen.catalogue.methods.window import Window
from strapgen.design.filters import responses
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.design.windows.window_report import WindowResult

#: Frequencies of a curve, and the lowest error that is drawn.
_POINTS, _LOWEST = 240, 1e-14


def window_image(result: WindowResult, path: str | Path) -> bytes:
    """Return the error of each filter against frequency, beside that of the polynomial through the same samples."""
    window = result.window
    curves = {_label(window): window}
    now = [one for one in window.one_sided if one.ahead < window.ahead]
    curves |= {_label(one): one for one in (now[len(now) // 2 :: max(1, len(now) - len(now) // 2 - 1)])}
    fit = replace(window, filters=responses.polynomial_fit(window))
    curves[f"polynomial through {window.samples} samples"] = fit
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
        axes.set_title(f"F_{m}", loc="left", fontsize=10)
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
