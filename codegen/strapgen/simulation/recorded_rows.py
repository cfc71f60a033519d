"""Reads rows of numbers from a recorded file: a block at a time by numpy, row by row what it does not take."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from strapgen.simulation.recorded_columns import Columns
from strapgen.support import checks, delimited
from strapgen.support.exceptions import InputError
from strapgen.support.suggestions import counted

Array = NDArray[np.float64]

#: Number of columns of a file without names: the time and three rates.
_UNNAMED = 4
#: Rows that are put together.
_BATCH = 1 << 13


class LineNumbers:
    """The number of the line of every row: the rows from which on it is another distance away."""

    def __init__(self) -> None:
        self._rows, self._lines = array("q"), array("q")

    def add(self, row: int, lines: Sequence[int]) -> None:
        """Note the line numbers of rows from a first one on."""
        for number, line in enumerate(lines, row):
            if not self._rows or line - number != self._lines[-1] - self._rows[-1]:
                self._rows.append(number)
                self._lines.append(line)
            elif isinstance(lines, range):  # one after the other
                break

    def __getitem__(self, row: int) -> int:
        place = bisect_right(self._rows, row) - 1
        return self._lines[place] + row - self._rows[place]


@dataclass(frozen=True)
class RecordedRows:
    """The rows of a file.

    Parameters
    ----------
    time : array, (N,)
        The first column.
    values : array, (N, columns)
        The others; a long recording is on the disk, see `recorded_columns`.
    lines : LineNumbers
        The number of the line of each row.
    """

    time: Array
    values: Array
    lines: LineNumbers


def read_rows(path: Path, names: tuple[str, ...] | None) -> RecordedRows:
    """Read columns of numbers.

    Parameters
    ----------
    path : Path
    names : tuple of str or None
        Names of the columns, which a header has in any order; None for the first four, whatever their names.

    Raises
    ------
    InputError
        If the file cannot be read, is beyond bounds, or a value is no finite number.
    """
    reading = _Reading(path, names)
    time, values, lines = Columns(1), Columns(len(reading.places) - 1), LineNumbers()
    for numbers, of_lines in reading.batches():
        lines.add(time.rows, of_lines)
        time.append(numbers[:, :1])
        values.append(numbers[:, 1:])
    if time.rows < 2:
        raise InputError(f"{path} holds {counted(time.rows, 'row')} of numbers; at least 2 are needed")
    return RecordedRows(time.array()[:, 0], values.array(), lines)


class _Reading:
    """The state of reading one file."""

    def __init__(self, path: Path, names: tuple[str, ...] | None) -> None:
        self.path = path
        self.names = names
        self.places = list(range(_UNNAMED if names is None else len(names)))
        self._is_begun = False

    def batches(self) -> Iterator[tuple[Array, Sequence[int]]]:
        """Yield rows of numbers, and the numbers of their lines."""
        blocks = delimited.blocks(self.path)
        first = 1
        for block in blocks:
            numbers = self._plain(block) if self._is_begun else None
            if numbers is not None:
                yield numbers, range(first, first + len(block))
            elif any('"' in line for line in block):  # a cell in quotation marks may go on in the next block
                yield from self._row_by_row(chain(block, chain.from_iterable(blocks)), first)
                return
            else:
                yield from self._row_by_row(iter(block), first)
            first += len(block)

    def _plain(self, block: list[str]) -> Array | None:
        """Return a block in which every line is a row of plain numbers; None for any other."""
        text = "".join(block)
        if '"' in text or "_" in text or not text.isascii():
            return None
        try:
            numbers = np.loadtxt(block, delimiter=",", usecols=self.places, ndmin=2, comments=None)
        except ValueError:
            return None
        return numbers if len(numbers) == len(block) and np.isfinite(numbers).all() else None

    def _row_by_row(self, lines: Iterator[str], first: int) -> Iterator[tuple[Array, Sequence[int]]]:
        rows = delimited.rows(self.path, lines, first)
        while batch := list(islice(rows, _BATCH)):
            if not self._is_begun:
                self._is_begun = True
                line, cells = batch[0]
                if not any(map(_resembles_number, cells)):
                    self._read_header(line, cells)
                    batch = batch[1:]
            if batch:
                numbers = [[self._number(line, row, place) for place in self.places] for line, row in batch]
                yield np.array(numbers), [line for line, _ in batch]

    def _read_header(self, line: int, cells: list[str]) -> None:
        header = [cell.strip().lower() for cell in cells]
        if self.names is None:
            return
        for name in self.names:
            if name not in header:
                raise InputError(
                    f"{self.path}, line {line}: no column {name!r}; the columns {', '.join(self.names)} are needed"
                )
        self.places = [header.index(name) for name in self.names]

    def _number(self, line: int, row: list[str], place: int) -> float:
        where = f"{self.path}, line {line}"
        if place >= len(row):
            raise InputError(f"{where}: {len(row)} columns; column {place + 1} is needed")
        number = checks.double(row[place])
        if not math.isfinite(number):
            cell = row[place].strip()
            raise InputError(f"{where}: column {place + 1} is {cell!r}; a finite number is needed")
        return number


def _resembles_number(cell: str) -> bool:
    """Return whether a cell is data: 1_0 is refused as a number, not skipped as a header."""
    try:
        float(cell)
    except ValueError:
        return False
    return True
