"""Hands records and tables to pandas and xarray, with the units in the names."""

from __future__ import annotations

import importlib
from functools import singledispatch
from typing import Any

import numpy as np

from strapgen.experiments.comparison import Comparisons
from strapgen.experiments.convergence import Convergence
from strapgen.reports import comparison, convergence, runs
from strapgen.reports.runs import ANGLES, AXES, SKEW_PLANES
from strapgen.reports.table import TextTable
from strapgen.simulation.courses import Course
from strapgen.simulation.recording import History
from strapgen.simulation.runs import Run
from strapgen.support.exceptions import MissingExtraError

#: Dimensions of matrices, and of vectors.
_MATRIX, _VECTOR = ("time_s", "row", "column"), ("time_s", "axis")


def pandas_frame(value: Any) -> Any:
    """Return an object as a data frame of pandas; records have the time in s as their index."""
    pandas = _library("pandas", "data frames")
    table = _table(value)
    frame = pandas.DataFrame(list(table.rows), columns=[column.header for column in table.columns])
    return frame.set_index("time_s") if "time_s" in frame.columns else frame


def xarray_dataset(value: Any) -> Any:
    """Return records as a dataset of xarray along the time in s."""
    xarray = _library("xarray", "datasets")
    variables, coordinates = _variables(value)
    return xarray.Dataset(
        {name: (dimensions, array, {"units": unit}) for name, (dimensions, array, unit) in variables.items()},
        coords={"time_s": ("time_s", value.time, {"units": "s"}), **coordinates},
    )


def _library(name: str, what: str) -> Any:
    """Return a library that is an extra."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(f"{what} need {name}: pip install 'strapgen[notebook]'") from None


@singledispatch
def _table(value: Any) -> TextTable:
    raise TypeError(f"{type(value).__name__} is no table")


@_table.register
def _(run: Run) -> TextTable:
    return runs.run_table(run)


@_table.register
def _(history: History) -> TextTable:
    return runs.history_table(history, runs.history_elements(history))


@_table.register
def _(course: Course) -> TextTable:
    return runs.course_table(course)


@_table.register
def _(rows: Comparisons) -> TextTable:
    return comparison.figures_table(rows)


@_table.register
def _(ladder: Convergence) -> TextTable:
    return convergence.ladder_table(ladder)


#: Variables by name: their dimensions, values and unit.
_Variables = dict[str, tuple[tuple[str, ...], Any, str]]


@singledispatch
def _variables(value: Any) -> tuple[_Variables, dict[str, Any]]:
    raise TypeError(f"{type(value).__name__} has no records")


@_variables.register
def _(run: Run) -> tuple[_Variables, dict[str, Any]]:
    variables: _Variables = {
        "scale": (_VECTOR, run.scale, "1"),
        "skew_deg": (("time_s", "plane"), np.degrees(run.skew), "deg"),
        "drift_deg": (_VECTOR, np.degrees(run.drift), "deg"),
        "computed": (_MATRIX, run.computed, "1"),
        "true": (_MATRIX, run.true, "1"),
        "error": (_MATRIX, run.error, "1"),
    }
    return variables, {"axis": list(AXES), "plane": list(SKEW_PLANES), "row": [1, 2, 3], "column": [1, 2, 3]}


@_variables.register
def _(history: History) -> tuple[_Variables, dict[str, Any]]:
    states = history.states.reshape(len(history.time), -1)
    names = runs.history_elements(history)
    return {"attitude": (("time_s", "element"), states, "1")}, {"element": list(names)}


@_variables.register
def _(course: Course) -> tuple[_Variables, dict[str, Any]]:
    states = course.states.reshape(len(course.time), -1)
    variables: _Variables = {
        "attitude": (("time_s", "element"), states, "1"),
        "angles_deg": (("time_s", "angle"), np.degrees(course.angles), "deg"),
        "velocity_change_m_s": (_VECTOR, course.velocity_changes, "m/s"),
    }
    return variables, {"element": list(course.elements), "angle": list(ANGLES), "axis": list(AXES)}
