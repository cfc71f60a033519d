"""MAT and HDF5 files: arrays of equally many rows that stand together are the columns of a table."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.lab.recordings.formats.extras import package, refusing
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic, unit_of
from strapgen.lab.recordings.long_columns import PART, Columns

Array = NDArray[Any]

HDF5, MAT = b"\x89HDF\r\n\x1a\n", b"MATLAB "
_NEW_MAT = b"MATLAB 7.3"
#: Most numbers in a row of an array, and most elements of an array of structures.
_MOST_NUMBERS, _MOST_STRUCTURES = 16, 100
#: Numbers beside the arrays that say how they were sampled.
_SAMPLING = re.compile(r"(?i).*(rate|freq|fs|hz|dt|period|interval)")


class ArrayLog:
    """A file of named arrays; a topic is named by the group or structure in which its arrays stand."""

    def __init__(self, path: Path, head: bytes) -> None:
        self.path = path
        is_hdf5 = head.startswith((HDF5, _NEW_MAT))
        self.format = "hdf5" if head.startswith(HDF5) else "mat"
        self._separator = "/" if is_hdf5 else "."
        self._remarks: list[str] = []
        #: By topic and name of a column: the array, the axis of its rows, and where the column stands in a row
        self._columns: dict[str, dict[str, tuple[Any, int, tuple[int, ...]]]] = {}
        with refusing(path, "a table of arrays"):
            if is_hdf5:
                self._file = package("h5py", "HDF5 files").File(path, "r")
                found = [*self._of_group(self._file, ())]
            else:
                loaded = package("scipy.io", "MAT files").loadmat(path, simplify_cells=True)
                found = [*self._of_structure(loaded, ())]
        topics = [*self._tables(found)]
        self.topics: tuple[LogTopic, ...] = tuple(sorted(topics, key=lambda topic: topic.name))
        self.remarks = tuple(self._remarks)

    def _of_group(self, group: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any, str]]:
        """Yield the path, array and unit of each dataset, and numbers among the attributes."""
        for name, value in group.attrs.items():
            if np.ndim(value) == 0 and np.asarray(value).dtype.kind in "iuf":
                yield (*path, name), value, ""
        for name, item in group.items():
            if name.startswith("#"):  # MATLAB's own
                continue
            if hasattr(item, "items"):
                yield from self._of_group(item, (*path, name))
            elif item.dtype.names:
                for label in item.dtype.names:
                    if item.dtype[label].kind in "biuf":
                        yield (*path, name, label), item.fields(label), ""
            elif item.dtype.kind in "biuf" and item.attrs.get("MATLAB_class", b"") not in (b"char", b"cell"):
                unit = item.attrs.get("units", item.attrs.get("unit", ""))
                yield (*path, name), item, unit if isinstance(unit, str) else ""

    def _of_structure(self, of: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any, str]]:
        """Yield the path and array of each variable."""
        if isinstance(of, dict):
            for name, item in of.items():
                if not name.startswith("__"):
                    yield from self._of_structure(item, (*path, name))
        elif (isinstance(of, np.ndarray) and of.dtype.kind == "O") or isinstance(of, list):
            for index, item in enumerate(np.ravel(np.asarray(of, object))[:_MOST_STRUCTURES]):
                if isinstance(item, dict):
                    yield from self._of_structure(item, (*path[:-1], f"{path[-1]}[{index}]"))
        elif type(of).__name__.startswith("Matlab"):
            self._remarks.append(f"{self._separator.join(path)} is an object that MATLAB alone opens")
        elif np.asarray(of).dtype.kind in "biuf":
            yield path, np.asarray(of), ""

    def _tables(self, found: list[tuple[tuple[str, ...], Any, str]]) -> Iterator[LogTopic]:
        groups: dict[tuple[tuple[str, ...], int], list[tuple[str, Any, str]]] = {}
        for path, array, unit in found:
            shape = getattr(array, "shape", None) or (len(array),) if np.ndim(array) else ()
            rows = max(shape, default=0)
            if rows > 1 and np.prod(shape) // rows <= _MOST_NUMBERS:
                groups.setdefault((path[:-1], rows), []).append((path[-1], array, unit))
            elif np.prod(shape, dtype=int) == 1 and _SAMPLING.fullmatch(path[-1]):
                value = float(np.ravel(np.asarray(array))[0])
                self._remarks.append(f"{self._separator.join(path)} is {value:.12g}")
        largest: dict[tuple[str, ...], int] = {}
        for (place, rows), arrays in groups.items():
            if len(arrays) > len(groups.get((place, largest.get(place, 0)), [])):
                largest[place] = rows
        for (place, rows), arrays in groups.items():
            for name, members in (
                [(place, arrays)] if largest[place] == rows else [((*place, one[0]), [one]) for one in arrays]
            ):
                yield self._topic(self._separator.join(name), rows, members)

    def _topic(self, name: str, rows: int, arrays: list[tuple[str, Any, str]]) -> LogTopic:
        columns = []
        places = self._columns.setdefault(name, {})
        for label, array, unit in arrays:
            shape = np.shape(array)
            axis = shape.index(rows)
            rest = shape[:axis] + shape[axis + 1 :]
            order = rest if self._separator == "." or self.format == "hdf5" else rest[::-1]
            for index in product(*map(range, order)):
                full = label + "".join(f"[{k}]" for k in index if np.prod(rest) > 1)
                places[full] = array, axis, index if order == rest else index[::-1]
                columns.append(LogColumn(full, unit_of(full, unit)))
        return LogTopic(name, tuple(columns), rows)

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns of a topic by name."""
        result = {}
        with refusing(self.path, "a table of arrays"):
            for name in columns:
                array, axis, place = self._columns[topic][name]
                rows = np.shape(array)[axis]
                store = Columns(1, np.int64)
                for first in range(0, rows, PART):
                    where = (*place[:axis], slice(first, min(first + PART, rows)), *place[axis:])
                    part = np.asarray(array[where])
                    store.append(part.astype(np.float64 if part.dtype.kind == "f" else np.int64))
                result[name] = store.array()[:, 0]
        return result

    def place(self, topic: str, row: int) -> str:
        """Return the number of a row, from 1 on."""
        return f"row {row + 1}"
