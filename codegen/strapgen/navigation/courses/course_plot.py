"""Plots courses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.runs_report import ANGLES, AXES
from strapgen.results import figures

if TYPE_CHECKING:
    from strapgen.navigation.courses.course_report import CourseResult
    from strapgen.navigation.courses.courses import Course


def course_image(result: CourseResult, path: str | Path) -> bytes:
    """Return attitude and velocity changes along a recording against time."""
    return figures.image(course_figure(result.course, result.plot_title), path)


def course_figure(course: Course, title: str) -> Any:
    """Return the figure of `course_image`."""
    figure, grid = figures.grid_of_axes(2, 3, (12, 6))
    parts = (
        [f"{name}, deg" for name in ANGLES],
        [f"velocity change along {axis}, m/s" for axis in AXES],
    )
    values = (np.degrees(course.angles), course.velocity_changes)
    for row, names in enumerate(parts):
        for column, name in enumerate(names):
            axes = grid[row, column]
            axes.plot(course.time, values[row][:, column], color=figures.COLOURS[row], linewidth=1.2)
            axes.set_title(name, loc="left", fontsize=10)
            figures.style_over_time(axes)
            if row == 1:
                axes.set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure
