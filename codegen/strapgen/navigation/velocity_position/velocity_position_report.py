"""Velocity and position of several algorithms, as a result and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from strapgen.navigation.velocity_position.velocity_position_study import Flight, TranslationStanding
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, properties, reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable

_ERROR, _COUNT = ".3g", ".4g"


@dataclass(frozen=True)
class TranslationRow:
    """What an algorithm costs for each sample, and the largest errors of its velocity and position."""

    name: str = field(metadata=entry("algorithm", align="<"))
    multiply: float = field(metadata=entry("multiply", _COUNT))
    add: float = field(metadata=entry("add", _COUNT))
    velocity_m_s: float = field(metadata=entry("velocity, m/s", _ERROR))
    position_m: float = field(metadata=entry("position, m", _ERROR))


@dataclass(frozen=True)
class TranslationResult(Result):
    """Velocity and position of several algorithms along a motion with a specific force."""

    rows_in = "algorithms"
    computed = properties(
        motion=entry(),
        force=entry(),
        sample_hz=entry(),
        duration_s=entry(),
        backend=entry(),
        algorithms=entry(),
    )
    drawn_by = f"{__name__}:translation_image"

    standings: Sequence[TranslationStanding] = field(metadata=INTERNAL)
    flight: Flight = field(metadata=INTERNAL)
    #: The motion and the force in words
    described: str = field(metadata=INTERNAL)

    @property
    def motion(self) -> str:
        """Name of the motion."""
        return self.flight.motion.name

    @property
    def force(self) -> dict[str, Any]:
        """The specific force: its name and its parameters."""
        return {"name": self.flight.force.name, **self.flight.force.parameters}

    @property
    def sample_hz(self) -> float:
        """Sampling rate."""
        return float(self.flight.sample_hz)

    @property
    def duration_s(self) -> float:
        """Length of the run."""
        return float(self.flight.duration)

    @property
    def backend(self) -> str:
        """Name of the back end."""
        return self.flight.backend

    @property
    def algorithms(self) -> list[TranslationRow]:
        """The algorithms."""
        return [
            TranslationRow(one.name, one.multiply, one.add, one.velocity, one.position)
            for one in self.standings
        ]

    def table(self) -> TextTable:
        """Return the algorithms under their headers."""
        return reader_table(self.algorithms, TranslationRow)

    def text(self) -> str:
        """Return the table with its head."""
        lines = [
            f"largest errors over {self.duration_s:g} s at {self.sample_hz:g} Hz, back end {self.backend}:",
            self.described,
            "operations for each sample: attitude, velocity and position; N+P+L: samples of a step, from before it, "
            "after it",
            "",
            *self.table().lines(),
        ]
        return "\n".join(lines)


def translation_image(result: TranslationResult, path: str | Path) -> bytes:
    """Return the errors of velocity and position over the multiplications for each sample."""
    figure, grid = figures.grid_of_axes(1, 2, (11, 4.6))
    panels = (("error of the velocity, m/s", "velocity"), ("error of the position, m", "position"))
    several = []
    for axes, (label, part) in zip(grid[0], panels, strict=True):
        points = {one.name: (one.multiply, getattr(one, part)) for one in result.standings}
        for x, y in points.values():
            axes.plot([x], [y], "o", color="0.25", markersize=5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("multiplications for each sample")
        axes.set_ylabel(label)
        figures.style(axes)
        several.append((axes, points))
    figures.title(figure, result.described)
    figure.draw_without_rendering()  # axes have their places
    for axes, points in several:
        figures.labels_beside_points(axes, points, dict.fromkeys(points, "0.25"))
    return figures.image(figure, path)
