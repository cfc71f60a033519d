"""How the objects of navigation show themselves: as data frames, as plots."""

from __future__ import annotations

from typing import Any

import numpy as np

from strapgen.lab.runs_report import ANGLES, AXES
from strapgen.navigation.courses import Course, course_figure, course_table
from strapgen.results.display.frames import VECTOR, Variables, table, variables
from strapgen.results.display.objects import figure
from strapgen.results.table import TextTable


@table.register
def _(course: Course) -> TextTable:
    return course_table(course)


@variables.register
def _(course: Course) -> tuple[Variables, dict[str, Any]]:
    states = course.states.reshape(len(course.time), -1)
    arrays: Variables = {
        "attitude": (("time_s", "element"), states, "1"),
        "angles_deg": (("time_s", "angle"), np.degrees(course.angles), "deg"),
        "velocity_change_m_s": (VECTOR, course.velocity_changes, "m/s"),
    }
    return arrays, {"element": list(course.elements), "angle": list(ANGLES), "axis": list(AXES)}


@figure.register
def _(course: Course, title: str) -> Any:
    return course_figure(course, title)
