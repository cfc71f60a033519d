"""Records and tables for pandas and xarray, with the units in the names."""

from __future__ import annotations

import importlib
from functools import singledispatch
from typing import Any

from strapgen.ir.exceptions import MissingExtraError
from strapgen.results.table import TextTable

#: Dimensions of matrices, and of vectors.
MATRIX, VECTOR = ("time_s", "row", "column"), ("time_s", "axis")


def pandas_frame(value: Any) -> Any:
    """Return an object as a data frame of pandas; records have the time in s as their index."""
    pandas = _library("pandas", "data frames")
    rows = table(value)
    frame = pandas.DataFrame(list(rows.rows), columns=[column.header for column in rows.columns])
    return frame.set_index("time_s") if "time_s" in frame.columns else frame


def xarray_dataset(value: Any) -> Any:
    """Return records as a dataset of xarray along the time in s."""
    xarray = _library("xarray", "datasets")
    arrays, coordinates = variables(value)
    return xarray.Dataset(
        {name: (dimensions, array, {"units": unit}) for name, (dimensions, array, unit) in arrays.items()},
        coords={"time_s": ("time_s", value.time, {"units": "s"}), **coordinates},
    )


def _library(name: str, what: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(f"{what} need {name}: pip install 'strapgen[notebook]'") from None


@singledispatch
def table(value: Any) -> TextTable:
    """Return an object as a table."""
    raise TypeError(f"{type(value).__name__} is no table")


#: Variables by name: their dimensions, values and unit.
Variables = dict[str, tuple[tuple[str, ...], Any, str]]


@singledispatch
def variables(value: Any) -> tuple[Variables, dict[str, Any]]:
    """Return records as variables by name, and the coordinates of their dimensions."""
    raise TypeError(f"{type(value).__name__} has no records")
