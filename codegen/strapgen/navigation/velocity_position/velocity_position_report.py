"""Reports velocity and position of several algorithms as text, data, table and picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from strapgen.navigation.velocity_position.velocity_position_study import Flight, TranslationStanding
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_ERROR, _COUNT = ".3g", ".4g"
_COLUMNS = (
    Column("algorithm", "<"),
    Column("multiply", spec=_COUNT),
    Column("add", spec=_COUNT),
    Column("velocity, m/s", spec=_ERROR),
    Column("position, m", spec=_ERROR),
)


def translation_report(standings: Sequence[TranslationStanding], flight: Flight, described: str) -> Report:
    """Return the standings of a study as a report.

    `described`: the motion and the force in words.
    """

    def table() -> TextTable:
        rows = [[one.name, one.multiply, one.add, one.velocity, one.position] for one in standings]
        return TextTable(_COLUMNS, rows)

    def text() -> str:
        lines = [
            f"largest errors over {float(flight.duration):g} s at {float(flight.sample_hz):g} Hz, back end "
            f"{flight.backend}:",
            described,
            "operations for each sample: attitude, velocity and position; N+P+L: samples of a step, from before it, "
            "after it",
            "",
            *table().lines(),
        ]
        return "\n".join(lines) + "\n"

    def data() -> dict[str, Any]:
        return {
            "motion": flight.motion.name,
            "force": {"name": flight.force.name, **flight.force.parameters},
            "sample_hz": float(flight.sample_hz),
            "duration_s": float(flight.duration),
            "backend": flight.backend,
            "algorithms": [
                {
                    "name": one.name,
                    "multiply": one.multiply,
                    "add": one.add,
                    "velocity_m_s": one.velocity,
                    "position_m": one.position,
                }
                for one in standings
            ],
        }

    return Report(text, data, table)


def translation_image(standings: Sequence[TranslationStanding], described: str, path: str | Path) -> bytes:
    """Return the errors of velocity and position over the multiplications for each sample.

    `described`: the motion and the force in words, for the title.
    """
    figure, grid = figures.grid_of_axes(1, 2, (11, 4.6))
    panels = (("error of the velocity, m/s", "velocity"), ("error of the position, m", "position"))
    several = []
    for axes, (label, part) in zip(grid[0], panels, strict=True):
        points = {one.name: (one.multiply, getattr(one, part)) for one in standings}
        for x, y in points.values():
            axes.plot([x], [y], "o", color="0.25", markersize=5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("multiplications for each sample")
        axes.set_ylabel(label)
        figures.style(axes)
        several.append((axes, points))
    figures.title(figure, described)
    figure.draw_without_rendering()  # axes have their places
    for axes, points in several:
        figures.labels_beside_points(axes, points, dict.fromkeys(points, "0.25"))
    return figures.image(figure, path)
