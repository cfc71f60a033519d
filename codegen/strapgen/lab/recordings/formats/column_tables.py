"""Parquet and Feather files, through pyarrow, a batch of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.lab.recordings.formats.extras import package, refusing
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic, unit_of
from strapgen.lab.recordings.long_columns import PART, Columns

Array = NDArray[Any]

MAGICS = {b"PAR1": "parquet", b"ARROW1": "feather", b"FEA1": "feather"}
#: Most elements of a list in a cell.
_MOST_ELEMENTS = 16


class ColumnLog:
    """A table whose columns stand one behind the other; the elements of lists and structures are columns too."""

    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.format = path, kind
        self._arrow = package("pyarrow", "Parquet and Feather files")
        with refusing(path, f"a {kind.capitalize()} file"):
            if kind == "parquet":
                self._parquet = package("pyarrow.parquet", "Parquet files").ParquetFile(path, memory_map=True)
                schema, rows = self._parquet.schema_arrow, self._parquet.metadata.num_rows
            else:
                self._table = package("pyarrow.feather", "Feather files").read_table(path, memory_map=True)
                schema, rows = self._table.schema, self._table.num_rows
            self._fields = {field.name: field for field in schema}
            first = next(iter(self._batches([*self._fields], 1)), None)
            columns = [column for field in schema for column in self._columns(field, first)]
        self.topics: tuple[LogTopic, ...] = (LogTopic("", tuple(columns), rows),)

    def _batches(self, names: Sequence[str], rows: int = PART) -> Iterator[Any]:
        if self.format == "parquet":
            yield from self._parquet.iter_batches(rows, columns=[*names])
        else:
            yield from self._table.select([*names]).to_batches(rows)

    def _columns(self, field: Any, first: Any) -> Iterator[LogColumn]:
        types = self._arrow.types
        metadata = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
        stated = metadata.get("unit", metadata.get("units", ""))
        for name, kind in self._numbers(
            field.name, field.type, None if first is None else first.column(field.name)
        ):
            has_unit = types.is_timestamp(kind) or types.is_duration(kind) or types.is_time(kind)
            yield LogColumn(name, kind.unit if has_unit else unit_of(name, stated))

    def _numbers(self, name: str, kind: Any, first: Any) -> Iterator[tuple[str, Any]]:
        """Yield the columns of numbers in a column, with their types."""
        types = self._arrow.types
        if types.is_struct(kind):
            for field in kind:
                inner = None if first is None else first.field(field.name)
                yield from self._numbers(f"{name}.{field.name}", field.type, inner)
        elif types.is_fixed_size_list(kind) or types.is_list(kind) or types.is_large_list(kind):
            length = kind.list_size if types.is_fixed_size_list(kind) else len(first[0]) if first else 0
            for index in range(length if length <= _MOST_ELEMENTS else 0):
                yield from self._numbers(f"{name}[{index}]", kind.value_type, None)
        elif not (
            types.is_string(kind)
            or types.is_large_string(kind)
            or types.is_binary(kind)
            or types.is_null(kind)
        ):
            yield name, kind

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns by name; a cell without a value is nan."""
        stores = {name: Columns(1, np.int64) for name in columns}
        of = {name: max((f for f in self._fields if name.startswith(f)), key=len) for name in columns}
        with refusing(self.path, f"a {self.format.capitalize()} file"):
            for batch in self._batches(sorted({*of.values()})):
                for name, store in stores.items():
                    store.append(self._part(batch.column(of[name]), name[len(of[name]) :]))
        return {name: store.array()[:, 0] for name, store in stores.items()}

    def _part(self, array: Any, path: str) -> Array:
        """Return the numbers that a path as .x or [2] leads to."""
        compute, types = package("pyarrow.compute", "Parquet files"), self._arrow.types
        while path:
            if path.startswith("."):
                name = max((f.name for f in array.type if path[1:].startswith(f.name)), key=len)
                array, path = compute.struct_field(array, name), path[1 + len(name) :]
            else:
                index, _, path = path[1:].partition("]")
                array = compute.list_element(array, int(index))
        if types.is_timestamp(array.type) or types.is_duration(array.type):
            array = array.cast(self._arrow.int64())
        elif not types.is_integer(array.type) or array.null_count:
            array = array.cast(self._arrow.float64())
        elif types.is_uint64(array.type):
            array = array.cast(self._arrow.int64())
        numbers: Array = array.to_numpy(zero_copy_only=False)
        return numbers.astype(np.int64 if numbers.dtype.kind in "iu" else np.float64, copy=False)

    def place(self, topic: str, row: int) -> str:
        """Return the number of a row, from 1 on."""
        return f"row {row + 1}"
