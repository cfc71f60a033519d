"""Arrays and data frames as logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic

Array = NDArray[Any]


@dataclass
class ArrayLog:
    """Columns in memory."""

    columns: Mapping[str, Any]
    path: Path = Path("the recording")
    format: str = "arrays"
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.topics: tuple[LogTopic, ...] = (LogTopic("", tuple(map(LogColumn, self.columns)), None),)

    @classmethod
    def of(cls, time: Any, **samples: Any) -> ArrayLog:
        """Return a log of times and of samples about three axes, by what is before the axis in the columns' names."""
        columns = {"t": _column("time", time)}
        if columns["t"].ndim != 1:
            raise InputError(f"time has shape {columns['t'].shape}; (N,) is needed")
        for name, values in samples.items():
            if values is not None:
                table = checks.numbers(name, values, (None, 3))
                if table.shape != (len(columns["t"]), 3):
                    raise InputError(
                        f"{name} has shape {table.shape}; ({len(columns['t'])}, 3) is needed, as for time"
                    )
                columns |= {f"{name}_{axis}": table[:, k] for k, axis in enumerate("xyz")}
        return cls(columns)

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns, (rows,) each."""
        read = {name: _column(name, self.columns[name]) for name in columns}
        lengths = {len(array) for array in read.values()}
        if len(lengths) > 1 or any(array.ndim != 1 for array in read.values()):
            shapes = ", ".join(f"{name} {array.shape}" for name, array in read.items())
            raise InputError(f"the columns have the shapes {shapes}; (N,) is needed")
        return read

    def place(self, topic: str, row: int) -> str:
        """Return where a row stands."""
        return f"row {row}"


def frame_log(frame: Any) -> ArrayLog:
    """Return a data frame as a log: whatever has named columns that NumPy takes as arrays."""
    if isinstance(frame, Mapping) and not hasattr(frame, "coords"):
        names = [*frame]
    elif hasattr(frame, "column_names"):  # pyarrow
        names = [*frame.column_names]
    elif hasattr(frame, "columns"):  # pandas, polars
        names = [*frame.columns]
    elif hasattr(frame, "coords"):  # xarray
        names = [*frame.coords, *frame]
    elif hasattr(frame, "__dataframe__"):
        names = [*frame.__dataframe__().column_names()]
    else:
        raise InputTypeError(
            f"frame is {checks.describe(frame)}; a data frame or a mapping of columns is needed"
        )
    columns = {str(name): frame[name] for name in names}
    index = getattr(frame, "index", None)
    if index is not None and not callable(index) and (index.name is not None or index.dtype.kind == "M"):
        columns = {str(index.name or "time"): index} | columns
    return ArrayLog(columns)


def _column(name: str, values: Any) -> Array:
    """Return a column as an array of numbers or times; what is missing is nan."""
    array = np.asarray(values)
    if array.dtype.kind == "O":
        with suppress(TypeError, ValueError):
            array = np.array([np.nan if value is None else value for value in array.tolist()], np.float64)
    if array.dtype.kind not in "fiuM":
        raise InputTypeError(f"{name} has dtype {array.dtype}; numbers are needed")
    return array
