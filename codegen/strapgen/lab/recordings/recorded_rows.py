"""Reads rows of numbers from a recorded file: in blocks by numpy, and row by row where numpy fails."""

from __future__ import annotations

import csv
import io
import math
import mmap
import re
import tempfile
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, islice
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.units import TIMES
from strapgen.lab.recordings.recorded_header import ColumnLayout
from strapgen.storage import streams

Array = NDArray[np.float64]

#: What separates cells, the first of which a line holds.
_SEPARATORS = ("\t", ";", ",")
#: What a line begins with that is a comment.
_COMMENTS = ("#", "%", "//")
#: From this interval on times in no stated unit may be in ms, us, ns or numbers of packets, in s.
_LONG_INTERVAL = 0.5
#: Rows that are put together.
_BATCH = 1 << 13

#: Returns where the columns stand, from the cells of the header and the number of cells of a row.
Find = Callable[[Sequence[str] | None, int], ColumnLayout]

#: Numbers that a column store holds in memory, and rows that are worked on together.
_IN_MEMORY = 1 << 22
PART = 1 << 18

#: Most rows of a file, characters of a line and cells of a row. An hour at 10 kHz has 36 million rows.
MOST_ROWS, MOST_CHARACTERS, MOST_CELLS = 50_000_000, 20_000, 1_000
#: Lines that are handed out together.
_BLOCK = 1 << 13


class LineNumbers:
    """Line numbers of rows, stored where the distance between row and line changes."""

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
    """The rows of a file."""

    #: (N,): the first column
    time: Array
    #: (N, columns): the others; a long recording is on the disk, see `Columns`
    values: Array
    #: The number of the line of each row
    lines: LineNumbers


def read_rows(
    path: Path, find: Find, sample_hz: float | str | Fraction | None = None
) -> tuple[RecordedRows, ColumnLayout]:
    """Read columns of numbers.

    Cells are separated by commas, semicolons, tabs or blanks. Lines before the header that begin with #, % or // are
    comments; the last of them is the header if it names the columns.

    `sample_hz`: sampling rate in Hz of a file without times. Returns: times in s; values as they stand.
    """
    reading = _Reading(path, find)
    time, values, lines = Columns(1), Columns(3), LineNumbers()
    for numbers, of_lines in reading.batches():
        layout = reading.layout
        if not time.rows and not values.rows:
            values = Columns(len(layout.places) - layout.has_time)
        lines.add(values.rows, of_lines)
        if layout.has_time:
            time.append(numbers[:, :1] * float(TIMES[layout.time_unit or "s"]))
        values.append(numbers[:, int(layout.has_time) :])
    if values.rows < 2:
        raise InputError(f"{path} holds {counted(values.rows, 'row')} of numbers; at least 2 are needed")
    layout = reading.layout
    if sample_hz is not None:
        step = 1 / float(checks.number("sample_hz", sample_hz, positive=True))
        stamps = step * np.arange(values.rows, dtype=np.float64)
    else:
        stamps = time.array()[:, 0]
    if layout.has_time and layout.time_unit is None:
        _require_plausible(path, stamps)
    return RecordedRows(stamps, values.array(), lines), layout


def _require_plausible(path: Path, time: Array) -> None:
    """Refuse times without a unit whose intervals are no gyro's in s."""
    with np.errstate(over="ignore"):  # times that are too far apart are refused as such
        median = float(np.median(np.abs(np.diff(time[: 1 << 12]))))
    if _LONG_INTERVAL <= median < np.inf:
        raise InputError(
            f"{path}: the time states no unit and grows by {median:g} from row to row; --time-unit s, ms, us or ns "
            "says what it is, or --sample-hz the sampling rate"
        )


class _Reading:
    """The state of reading one file."""

    def __init__(self, path: Path, find: Find) -> None:
        self.path = path
        self.find = find
        self.layout = ColumnLayout((), 0)
        self.separator: str | None = ","
        self._is_begun = False

    def batches(self) -> Iterator[tuple[Array, Sequence[int]]]:
        """Yield rows of numbers, and the numbers of their lines."""
        blocks = line_blocks(self.path)
        first = 1
        for block in blocks:
            lines, number = self._begin(block, first) if not self._is_begun else (block, first)
            numbers = self._plain(lines) if self._is_begun else None
            if numbers is not None:
                yield numbers, range(number, number + len(lines))
            elif any('"' in line for line in lines):  # a cell in quotation marks may go on in the next block
                yield from self._row_by_row(chain(lines, chain.from_iterable(blocks)), number)
                return
            else:
                yield from self._row_by_row(iter(lines), number)
            first += len(block)

    def _begin(self, block: list[str], first: int) -> tuple[list[str], int]:
        """Take comments and the header from a block; return the lines of data, and the number of the first."""
        comment: str | None = None
        for place, line in enumerate(block):
            text = line.strip()
            if not text:
                continue
            if text.startswith(_COMMENTS):
                comment = text
                continue
            self.separator = next((mark for mark in _SEPARATORS if mark in text), None)
            cells = self._cells(line)
            self._is_begun = True
            where = f"{self.path}, line {first + place}"
            if not any(map(_resembles_number, cells)):
                self._find(cells, len(cells), where)
                return block[place + 1 :], first + place + 1
            header = None if comment is None else self._cells(comment.lstrip("#%/ "))
            self._find(header if header and len(header) == len(cells) else None, len(cells), where)
            return block[place:], first + place
        return [], first + len(block)

    def _find(self, header: list[str] | None, width: int, where: str) -> None:
        try:
            self.layout = self.find(header, width)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None

    def _cells(self, line: str) -> list[str]:
        if self.separator is None:
            return line.split()
        cells = next(csv.reader([line], delimiter=self.separator), [])
        return cells[:-1] if len(cells) > 1 and not cells[-1].strip() else cells

    def _plain(self, block: list[str]) -> Array | None:
        """Return a block in which every line is a row of plain numbers; None for any other."""
        text = "".join(block)
        if '"' in text or "_" in text or not text.isascii() or not block:
            return None
        mark, width = self.separator, self.layout.width
        if any((len(line.split()) if mark is None else line.count(mark) + 1) != width for line in block):
            return None
        try:
            numbers = np.loadtxt(block, delimiter=mark, usecols=self.layout.places, ndmin=2, comments=None)
        except ValueError:
            return None
        return numbers if len(numbers) == len(block) and np.isfinite(numbers).all() else None

    def _row_by_row(self, lines: Iterator[str], first: int) -> Iterator[tuple[Array, Sequence[int]]]:
        if self.separator is None:
            lines = (",".join(line.split()) + "\n" for line in lines)
        rows = csv_rows(self.path, lines, first, self.separator or ",")
        while batch := list(islice(rows, _BATCH)):
            numbers = [self._numbers(line, row) for line, row in batch]
            yield np.array(numbers), [line for line, _ in batch]

    def _numbers(self, line: int, row: list[str]) -> list[float]:
        """Return the numbers of a row, which has as many cells as the header."""
        width, where = self.layout.width, f"{self.path}, line {line}"
        extra = row[width:]
        if len(row) < width or any(cell.strip() for cell in extra):
            comma = "; is the comma a decimal one?" if self.separator == "," and len(row) > width else ""
            raise InputError(f"{where}: {counted(len(row), 'column')}; {width} are needed{comma}")
        return [self._number(where, row, place) for place in self.layout.places]

    def _number(self, where: str, row: list[str], place: int) -> float:
        cell = row[place].strip()
        if self.separator != "," and re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", cell):
            cell = cell.replace(",", ".")
        number = checks.double(cell)
        if not math.isfinite(number):
            raise InputError(f"{where}: column {place + 1} is {cell!r}; a finite number is needed")
        return number


def _resembles_number(cell: str) -> bool:
    """Return whether a cell is data: 1_0 is refused as a number, not skipped as a header."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


class Columns:
    """A table of numbers that grows by rows."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.rows = 0
        self._parts: list[Array] = []
        self._file: IO[bytes] | None = None

    def append(self, part: Any) -> None:
        """Add rows, (N, width)."""
        part = np.ascontiguousarray(part, np.float64)
        self.rows += len(part)
        self._parts.append(part)
        if self._file is None and self.rows * self.width <= _IN_MEMORY:
            return
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="strapgen-")  # noqa: SIM115
            for waiting in self._parts:
                self._file.write(waiting.tobytes())
        except OSError as error:
            raise InputError(
                f"the temporary folder {tempfile.gettempdir()} does not hold so long a recording ({error.strerror})"
            ) from None
        self._parts.clear()

    def array(self) -> Array:
        """Return all rows, (rows, width)."""
        if self._file is None:
            return np.concatenate([np.empty((0, self.width)), *self._parts])
        try:
            self._file.flush()
        except OSError as error:
            raise InputError(
                f"the temporary folder {tempfile.gettempdir()} does not hold so long a recording ({error.strerror})"
            ) from None
        return np.memmap(self._file, np.float64, "r", shape=(self.rows, self.width))


def release(array: Any) -> None:
    """Let the system forget what it has read of an array on the disk; others stay as they are."""
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


class SampleIntervals:
    """The differences of rising times.

    `time` (N,): at least two finite times in s. `shortest, longest`: the interval in s, and the number of the
    time before it.
    """

    def __init__(self, time: Array) -> None:
        self._time = time
        self.count = len(time) - 1
        self.shortest, self.longest = (np.inf, 0), (-np.inf, 0)
        for first, part in self.parts():
            low, high = int(part.argmin()), int(part.argmax())
            self.shortest = min(self.shortest, (float(part[low]), first + low))
            if part[high] > self.longest[0]:
                self.longest = (float(part[high]), first + high)

    def parts(self) -> Iterator[tuple[int, Array]]:
        """Yield the intervals in parts, each with the number of its first one."""
        for first, part in parts(self._time, 1):
            yield first, np.diff(part)

    def at(self, place: int) -> float:
        """Return one interval."""
        return float(self._time[place + 1] - self._time[place])

    def median(self) -> float:
        """Return the median of intervals above 0."""
        if self.count <= PART:
            return float(np.median(np.diff(self._time)))
        middle = (self.count - 1) // 2
        low = self._of_rank(middle)
        return low if self.count % 2 else float(np.mean([low, self._of_rank(middle + 1)]))

    def _of_rank(self, rank: int) -> float:
        """Return the interval above which as many are shorter: bits of numbers above 0 are in their order."""
        low, high = (int(np.float64(value).view(np.int64)) for value in (self.shortest[0], self.longest[0]))
        while low < high:
            middle = (low + high) // 2
            if sum(int(np.count_nonzero(part.view(np.int64) <= middle)) for _, part in self.parts()) > rank:
                high = middle
            else:
                low = middle + 1
        return float(np.int64(low).view(np.float64))

    def farthest(self, value: float) -> tuple[float, int]:
        """Return the largest departure from a value, and the number of the first interval that has it."""
        worst = (-np.inf, 0)
        for first, part in self.parts():
            departures = np.abs(part - value)
            place = int(departures.argmax())
            if departures[place] > worst[0]:
                worst = (float(departures[place]), first + place)
        return worst


def line_blocks(path: Path) -> Iterator[list[str]]:
    """Yield the lines of a file, some thousands at a time."""
    count = 0
    try:
        with io.TextIOWrapper(streams.opened(path), encoding="utf-8-sig", newline="") as file:
            while block := list(islice(iter(lambda: file.readline(MOST_CHARACTERS + 1), ""), _BLOCK)):
                if max(map(len, block)) > MOST_CHARACTERS:
                    number = (
                        count + 1 + next(k for k, line in enumerate(block) if len(line) > MOST_CHARACTERS)
                    )
                    raise InputError(
                        f"{path}, line {number}: over {MOST_CHARACTERS} characters, which no line may have"
                    )
                count += len(block)
                if count > MOST_ROWS:
                    raise InputError(f"{path} has over {MOST_ROWS} lines; that is too many")
                yield block
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise _no_table(path, error) from None


def csv_rows(
    path: Path, lines: Iterator[str], first: int = 1, separator: str = ","
) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each row with the number of the line at which it ends."""
    reader = csv.reader(lines, delimiter=separator)
    try:
        for row in reader:
            if len(row) > MOST_CELLS:
                number = first - 1 + reader.line_num
                raise InputError(f"{path}, line {number}: {len(row)} cells; at most {MOST_CELLS} are allowed")
            # A blank line is skipped, but a row of empty cells lacks its data and is refused later.
            if len(row) > 1 or any(cell.strip() for cell in row):
                yield first - 1 + reader.line_num, row
    except csv.Error as error:
        raise _no_table(path, error) from None


def _no_table(path: Path, error: Exception) -> InputError:
    return InputError(f"{path} is no text file of comma-separated values ({error})")
