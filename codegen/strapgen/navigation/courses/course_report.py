"""Reports courses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.simulate.runs_report import ANGLES, AXES, TIME_COLUMN, settings_text, table_of, thinned
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

if TYPE_CHECKING:
    from strapgen.navigation.courses.courses import Course


def course_table(course: Course) -> TextTable:
    """Return attitude and velocity along a recording as a table."""
    count = len(course.time)
    columns = (
        course.time,
        course.states.reshape(count, -1),
        np.degrees(course.angles),
        course.velocity_changes,
    )
    header = [
        "time_s",
        *course.elements,
        *(f"{name}_deg" for name in ANGLES),
        *(f"dv{axis}_m_s" for axis in AXES),
    ]
    return table_of(header, np.column_stack(columns).tolist())


def course_report(course: Course, settings: dict[str, Any]) -> Report:
    """Return attitude and velocity along a recording as a report."""
    return Report(
        lambda: course_text(course, settings),
        lambda: course_data(course, settings),
        lambda: course_table(course),
        indented=False,
    )


def course_data(course: Course, settings: dict[str, Any]) -> dict[str, Any]:
    """Return attitude and velocity along a recording as plain JSON data after the settings."""
    return settings | {
        "unused_increments": course.unused,
        "elements": list(course.elements),
        "time_s": course.time.tolist(),
        "attitude": course.states.reshape(len(course.time), -1).tolist(),
        **{
            f"{name}_deg": np.degrees(column).tolist()
            for name, column in zip(ANGLES, course.angles.T, strict=True)
        },
        "velocity_changes_m_s": course.velocity_changes.tolist(),
    }


def course_text(course: Course, settings: dict[str, Any]) -> str:
    """Return attitude and velocity along a recording as a report."""
    shown = thinned(len(course.time))
    titles = [*(f"{name}, deg" for name in ANGLES), *(f"dv{axis}, m/s" for axis in AXES)]
    columns = [TIME_COLUMN, *(Column(title, spec=".8f", least=13, gap=1) for title in titles)]
    values = np.column_stack([course.time, np.degrees(course.angles), course.velocity_changes])
    lines = [settings_text(settings), "", *TextTable(columns, values[shown].tolist()).lines()]
    if len(shown) < len(course.time):
        lines.append(f"({len(shown)} of {len(course.time)} cycles; --format csv prints all)")
    if course.unused:
        lines.append(
            f"{course.unused} increments at the end make no whole navigation cycle and were not used"
        )
    return "\n".join(lines)
