"""Courses as results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.runs import Array
from strapgen.lab.runs_report import (
    ANGLES,
    AXES,
    TIME_COLUMN,
    RunSettings,
    settings_text,
    table_of,
    thinned,
)
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
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


@dataclass(frozen=True)
class CourseRecords:
    """Attitude and velocity along a recording."""

    #: Increments at the end that make no whole navigation cycle
    unused_increments: int
    #: Names of the elements of the attitude
    elements: tuple[str, ...]
    time_s: Array
    #: The elements at each time
    attitude: Array
    roll_deg: Array
    pitch_deg: Array
    heading_deg: Array
    #: Along x, y and z at each time
    velocity_changes_m_s: Array

    @staticmethod
    def of(course: Course) -> CourseRecords:
        """Return the records of a course."""
        roll, pitch, heading = np.degrees(course.angles).T
        return CourseRecords(
            unused_increments=course.unused,
            elements=course.elements,
            time_s=course.time,
            attitude=course.states.reshape(len(course.time), -1),
            roll_deg=roll,
            pitch_deg=pitch,
            heading_deg=heading,
            velocity_changes_m_s=course.velocity_changes,
        )


@dataclass(frozen=True)
class CourseResult(Result):
    """Attitude and velocity along an inertial recording."""

    drawn_by = "strapgen.navigation.courses.course_plot:course_image"
    indented = False

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    course: Course = field(metadata=entry(spread=True, write=CourseRecords.of, kind=CourseRecords))
    plot_title: str = field(default="", metadata=INTERNAL)

    def rows(self) -> Any:
        """Return the records of the course, as their times."""
        return self.course.time

    def table(self) -> TextTable:
        """Return attitude and velocity at each time."""
        return course_table(self.course)

    def text(self) -> str:
        """Return angles and velocity changes at most of the times that a reader looks at."""
        course, shown = self.course, thinned(len(self.course.time))
        titles = [*(f"{name}, deg" for name in ANGLES), *(f"dv{axis}, m/s" for axis in AXES)]
        columns = [TIME_COLUMN, *(Column(title, spec=".8f", least=13, gap=1) for title in titles)]
        values = np.column_stack([course.time, np.degrees(course.angles), course.velocity_changes])
        table = TextTable(columns, values[shown].tolist())
        lines = [settings_text({**self.settings}), "", *table.lines()]
        if len(shown) < len(course.time):
            lines.append(f"({len(shown)} of {len(course.time)} cycles; --format csv prints all)")
        if course.unused:
            lines.append(
                f"{course.unused} increments at the end make no whole navigation cycle and were not used"
            )
        return "\n".join(lines)
