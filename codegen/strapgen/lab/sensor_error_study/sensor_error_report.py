"""The errors of an attitude that sensors cause, beside their prediction, as a result and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from strapgen.lab.sensor_error_study.sensor_error_study import Array, SensorScatter
from strapgen.results import figures
from strapgen.results.records import entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_AXES = "xyz"


@dataclass(frozen=True)
class SensorErrorRow:
    """The error of the attitude on one axis at the end of the runs, positive if ahead of perfect sensors."""

    #: Which errors the sensors have: "all", or one kind alone
    cause: str
    #: 1 where all are the same
    runs: int
    axis: str = field(metadata=entry("axis"))
    mean_deg: float = field(metadata=entry("runs", ".4g", group="mean, deg"))
    #: Half the width of the interval of 95 % of the mean
    mean_margin_deg: float = field(metadata=entry("+-", ".4g", group="mean, deg"))
    #: Mean in closed form, to first order
    predicted_mean_deg: float = field(metadata=entry("predicted", ".4g", group="mean, deg"))
    #: Standard deviation over the runs
    deviation_deg: float = field(metadata=entry("runs", ".4g", group="standard deviation, deg"))
    #: Lower end of its interval of 95 %
    low_deg: float = field(metadata=entry("from", ".4g", group="standard deviation, deg"))
    #: Upper end of that interval
    high_deg: float = field(metadata=entry("to", ".4g", group="standard deviation, deg"))
    #: Standard deviation in closed form, to first order
    predicted_deg: float = field(metadata=entry("predicted", ".4g", group="standard deviation, deg"))


@dataclass(frozen=True)
class SensorErrorResult(Result):
    """The errors of the attitude that sensors cause, over many runs and in closed form."""

    drawn_by = f"{__name__}:sensor_image"
    indented = False

    #: The study, with what the errors are along the runs
    scatter: Sequence[SensorScatter] = field(
        metadata=entry(key="rows", write=lambda rows: _rows(rows), kind=list[SensorErrorRow])
    )
    #: File of the sensor errors
    errors: str
    algorithm: str
    method: str | None
    backend: str
    motion: str
    step_s: str = field(metadata=entry(unit="s"))

    def rows(self) -> Sequence[SensorErrorRow]:
        """Return a row for each cause and axis."""
        return _rows(self.scatter)

    def text(self) -> str:
        """Return the table with its head."""
        rows = self.rows()
        causes = [
            f"{row.cause}, {row.runs} runs"
            if row.axis == "x" and row.runs > 1
            else row.cause * (row.axis == "x")
            for row in rows
        ]
        table = reader_table(rows, SensorErrorRow)
        cells = [[cause, *row] for cause, row in zip(causes, table.rows, strict=True)]
        facts = {name: one for name, one in self.as_dict().items() if name != "rows"}
        return "\n".join(
            [
                ", ".join(f"{key} {value}" for key, value in facts.items()),
                f"errors of the attitude after {self.scatter[0].time[-1]:g} s in reference axes, positive if ahead of "
                "a run with perfect sensors;",
                "+-, from and to are intervals of 95 %; predicted to first order, in closed form",
                "",
                *TextTable([Column("", "<"), *table.columns], cells).lines(),
            ]
        )


def _rows(scatter: Sequence[SensorScatter]) -> list[SensorErrorRow]:
    return [
        SensorErrorRow(
            one.cause, one.runs, axis, *(float(np.degrees(part[-1, place])) for part in _parts(one))
        )
        for one in scatter
        for place, axis in enumerate(_AXES)
    ]


def _parts(one: SensorScatter) -> tuple[Array, ...]:
    """Return the parts of a row in rad, (N, 3) each."""
    means = (one.mean, one.mean_margin, one.predicted_mean)
    return *means, one.deviation, one.low, one.high, one.predicted


def sensor_image(result: SensorErrorResult, path: str | Path) -> bytes:
    """Return the standard deviations over time with their intervals, and the predicted ones as lines."""
    rows = result.scatter
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
