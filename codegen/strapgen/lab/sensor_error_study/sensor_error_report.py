"""Reports and draws the errors of an attitude that sensors cause, beside their prediction."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from strapgen.lab.sensor_error_study.sensor_error_study import SensorScatter
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_AXES = "xyz"
_KEYS = (
    *("cause", "runs", "axis", "mean_deg", "mean_margin_deg", "predicted_mean_deg"),
    *("deviation_deg", "low_deg", "high_deg", "predicted_deg"),
)
_COLUMNS = (
    Column("", "<"),
    Column("axis"),
    *(Column(header, spec=".4g", group="mean, deg", gap=2) for header in ("runs", "+-", "predicted")),
    *(
        Column(header, spec=".4g", group="standard deviation, deg", gap=2)
        for header in ("runs", "from", "to", "predicted")
    ),
)


def sensor_report(rows: Sequence[SensorScatter], settings: dict[str, Any]) -> Report:
    """Return a study of sensor errors as a report: the errors of the attitude at the end of the runs."""
    table: list[list[Any]] = [
        [row.cause, row.runs, axis, *(float(np.degrees(value)) for value in _numbers(row, place))]
        for row in rows
        for place, axis in enumerate(_AXES)
    ]

    def text() -> str:
        shown = [
            [
                f"{line[0]}, {line[1]} runs"
                if line[2] == "x" and line[1] > 1
                else line[0] * (line[2] == "x"),
                *line[2:],
            ]
            for line in table
        ]
        head = ", ".join(f"{key} {value}" for key, value in settings.items())
        return "\n".join(
            [
                head,
                f"errors of the attitude after {rows[0].time[-1]:g} s in reference axes, positive if ahead of a run "
                "with perfect sensors;",
                "+-, from and to are intervals of 95 %; predicted to first order, in closed form",
                "",
                *TextTable(_COLUMNS, shown).lines(),
            ]
        )

    def data() -> dict[str, Any]:
        return settings | {"rows": [dict(zip(_KEYS, line, strict=True)) for line in table]}

    return Report(
        text, data, lambda: TextTable([Column(key, spec=".6g") for key in _KEYS], table), indented=False
    )


def _numbers(row: SensorScatter, place: int) -> list[float]:
    """Return the numbers of an axis at the end of the runs in rad."""
    parts = (row.mean, row.mean_margin, row.predicted_mean, row.deviation, row.low, row.high, row.predicted)
    return [float(part[-1, place]) for part in parts]


def sensor_image(rows: Sequence[SensorScatter], path: str | Path) -> bytes:
    """Return the standard deviations over time with their intervals, and the predicted ones as lines."""
    whole, parts = rows[0], [row for row in rows[1:] if row.predicted.any() or row.deviation.any()]
    figure, grid = figures.grid_of_axes(1, 3, (11.0, 4.2), sharey=True)
    colours = figures.several_colours(1 + len(parts))
    for place, axes in enumerate(grid[0]):
        for row, colour in zip([whole, *parts], colours, strict=True):
            axes.plot(row.time, np.degrees(row.predicted[:, place]), "-", color=colour, label=row.cause)
            axes.plot(row.time, np.degrees(row.deviation[:, place]), ".", color=colour, markersize=4)
        low, high = np.degrees(whole.low[:, place]), np.degrees(whole.high[:, place])
        axes.fill_between(whole.time, low, high, color=colours[0], alpha=0.2, linewidth=0)
        axes.set_title(f"axis {_AXES[place]}", loc="left", fontsize=10)
        axes.set_xlabel("time, s")
        figures.style(axes)
    grid[0][0].set_ylabel("standard deviation, deg")
    figures.common_legend(figure, [grid[0][0]], loc="outside right center")
    figures.title(figure, "errors of the attitude by sensors: lines predicted, dots of the runs")
    return figures.image(figure, path)
