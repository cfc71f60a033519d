"""Long columns of numbers, which are kept on the disk and worked on in parts."""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterator, Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError

Array = NDArray[Any]

#: Numbers that a column store holds in memory, and rows that are worked on together.
_IN_MEMORY = 1 << 22
PART = 1 << 18


class Columns:
    """A table of numbers that grows by rows: doubles, or integers as long as all rows are of integers."""

    def __init__(self, width: int, kind: type = np.float64) -> None:
        self.width = width
        self.rows = 0
        self._kind: Any = np.dtype(kind)
        self._parts: list[Array] = []
        self._file: IO[bytes] | None = None

    @property
    def is_integer(self) -> bool:
        """Whether all rows so far are of integers."""
        return bool(self._kind != np.float64)

    def append(self, part: Any) -> None:
        """Add rows, (N, width) or (N,)."""
        part = np.asarray(part).reshape(-1, self.width)
        if self._kind != np.float64 and part.dtype != self._kind:
            self._to_doubles()
        self.rows += len(part)
        self._parts.append(np.ascontiguousarray(part, self._kind))
        if self._file is None and self.rows * self.width <= _IN_MEMORY:
            return
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="strapgen-")  # noqa: SIM115
            for waiting in self._parts:
                self._file.write(waiting.data)
        except OSError as error:
            raise _disk_full(error) from None
        self._parts.clear()

    def array(self) -> Array:
        """Return all rows, (rows, width)."""
        if self._file is None:
            return np.concatenate([np.empty((0, self.width), self._kind), *self._parts])
        try:
            self._file.flush()
        except OSError as error:
            raise _disk_full(error) from None
        return np.memmap(self._file, self._kind, "r", shape=(self.rows, self.width))

    def _to_doubles(self) -> None:
        doubles = Columns(self.width)
        for _, part in parts(self.array()):
            doubles.append(part)
        self._kind, self._parts, self._file = doubles._kind, doubles._parts, doubles._file


def _disk_full(error: OSError) -> InputError:
    return InputError(
        f"the temporary folder {tempfile.gettempdir()} does not hold so long a recording ({error.strerror})"
    )


class SideBySide:
    """Columns of doubles as the columns of one table, of which as much is put together as is asked for."""

    ndim = 2
    dtype = np.dtype(np.float64)

    def __init__(self, columns: Sequence[Array]) -> None:
        self.columns = columns
        self.shape = (len(columns[0]), len(columns))

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        """Return rows by a slice, which are not put together yet; rows by numbers; one row; or columns of those."""
        rows, *columns = key if isinstance(key, tuple) else (key,)
        if not isinstance(rows, slice):
            return np.stack([column[rows] for column in self.columns], axis=-1)[..., *columns]
        chosen: Any = np.arange(len(self.columns))[*columns]
        if np.ndim(chosen) == 0:
            return np.asarray(self.columns[int(chosen)][rows], np.float64)
        return SideBySide([self.columns[int(place)][rows] for place in chosen])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.stack(self.columns, axis=1, dtype=np.float64)


def release(array: Any) -> None:
    """Let the system forget what it has read of an array on the disk; others stay as they are."""
    if isinstance(array, SideBySide):
        for column in array.columns:
            release(column)
    while array is not None and not isinstance(array, mmap.mmap):
        array = getattr(array, "base", None)
    if array is not None and hasattr(array, "madvise"):
        array.madvise(mmap.MADV_DONTNEED)


def parts(array: Array, overlap: int = 0) -> Iterator[tuple[int, Array]]:
    """Yield the rows of an array in parts, each with the number of its first row.

    `array` has shape (N, ...).
    """
    for first in range(0, max(1, len(array) - overlap), PART):
        yield first, np.asarray(array[first : first + PART + overlap])
        release(array)


def largest_magnitude(array: Array) -> float:
    """Return the largest magnitude of an element; 0 if there is none, and no number if one is none."""
    return float(np.max([np.abs(part).max(initial=0.0) for _, part in parts(array)]))
