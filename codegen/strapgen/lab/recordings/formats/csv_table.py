"""Tables of text: columns are read in blocks, and cells one by one where they are no plain decimal numbers."""

from __future__ import annotations

import bz2
import csv
import gzip
import io
import lzma
import math
import re
import zlib
from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import import_module
from itertools import chain, islice
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks, units
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.formats.decimals import Marks
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic, unit_of
from strapgen.lab.recordings.long_columns import Columns
from strapgen.storage import streams

Array = NDArray[Any]

#: What separates cells; of those that a table may have the first. None stands for blanks.
_SEPARATORS = ("\t", ";", ",", "|", None)
#: What a line begins with that is a comment.
_COMMENTS = ("#", "%", "//")
_INTEGER = re.compile(r"[-+]?[0-9]{1,24}")
#: What a cell says that has no value.
_MISSING = ("", "na", "n/a", "null", "none", "nan", "-nan", "nan(ind)", "-nan(ind)")

#: Most rows of a file, characters of a line and cells of a row. An hour at 10 kHz has 36 million rows.
MOST_ROWS, MOST_CHARACTERS, MOST_CELLS = 50_000_000, 20_000, 1_000
#: Bytes that are read together, and lines from which a table is recognized.
_BLOCK = 1 << 20
_SAMPLE = 200

_COMMENT_BYTES = [mark.encode() for mark in _COMMENTS]
_COMPRESSED: dict[bytes, Any] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ": lzma.open}
_ZSTANDARD = b"\x28\xb5\x2f\xfd"


class Block(NamedTuple):
    """Whole lines, each ended by a line feed: the number of the first, how many, and their text."""

    first: int
    lines: int
    text: bytes


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


class CsvTable:
    """A table of text, with or without a header: without one the columns' names are their numbers from 1 on."""

    format = "csv"
    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows = LineNumbers()
        first = next((block.text for block in line_blocks(path)), b"")
        sample = list(islice(io.StringIO(_decoded(first)), _SAMPLE))
        self._separator = _separator(sample)
        #: Lines before the first row
        self._head = len(sample)
        columns = self._columns(sample)
        self._width = len(columns)
        self.topics: tuple[LogTopic, ...] = (LogTopic("", columns, None),)

    def _columns(self, sample: list[str]) -> tuple[LogColumn, ...]:
        """Return the columns from the lines at the top, and note how many of those come before the first row."""
        comment: list[str] = []
        rows: list[tuple[int, list[str]]] = []
        for place, line in enumerate(sample):
            text = line.strip()
            if text.startswith(_COMMENTS):
                comment = comment if rows else _cells(text.lstrip("#%/ "), self._separator)
            elif text:
                rows.append((place, _cells(line, self._separator)))
        if not rows:
            return ()
        widths = Counter(len(cells) for _, cells in rows if any(map(_resembles_number, cells)))
        width = widths.most_common(1)[0][0] if widths else len(rows[0][1])
        while len(rows[0][1]) != width and not all(map(_resembles_number, rows[0][1])):
            del rows[0]  # a title, or settings of a logger
        self._head, first = rows[0]
        self.first_line = self._head + 1
        if width > MOST_CELLS:
            raise _too_many_cells(self.path, self.first_line, width)
        names, stated = [""] * width, [""] * width
        if not any(map(_resembles_number, first)):
            names = first
            self._head += 1
            if len(rows) > 1 and len(rows[1][1]) in (width - 1, width) and _are_units(rows[1][1]):
                stated[: len(rows[1][1])], self._head = rows[1][1], rows[1][0] + 1
        elif len(comment) == width:
            names = comment
        columns: dict[str, LogColumn] = {}
        for number, (text, unit) in enumerate(zip(names, stated, strict=True), 1):
            name = text.strip().lstrip("#%/ ") or str(number)
            count = 2
            while name in columns:
                name, count = f"{text.strip()}.{count}", count + 1
            columns[name] = LogColumn(name, unit_of(name, unit))
        return tuple(columns.values())

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns by name."""
        names = self.topics[0].names
        places = [names.index(name) for name in columns]
        stores = [Columns(1, np.int64) for _ in places]
        self._rows, count = LineNumbers(), 0
        blocks = self._blocks()
        for block in blocks if columns else ():
            parts = (self._by_arrow(block, places, stores) if count else None) or self._plain(block, places)
            lines: Sequence[int] = range(block.first, block.first + block.lines)
            if parts is None:
                # A cell in quotation marks may go on in the next block.
                rest = blocks if b'"' in block.text else ()
                lines, parts = self._one_by_one(chain([block], rest), places)
            self._rows.add(count, lines)
            count += len(lines)
            for store, part in zip(stores, parts, strict=True):
                store.append(part)
        return {name: store.array()[:, 0] for name, store in zip(columns, stores, strict=True)}

    def place(self, topic: str, row: int) -> str:
        """Return the line of a row."""
        return f"line {self._rows[row]}"

    @property
    def _mark(self) -> bytes:
        return (self._separator or "\t").encode()

    def _blocks(self) -> Iterator[Block]:
        """Yield the lines below the header, with a point in numbers and one separator between cells."""
        for first, lines, text in line_blocks(self.path):
            if first <= self._head:
                text = b"".join(text.splitlines(keepends=True)[self._head :])
                first, lines = first + self._head, lines - self._head
            if self._separator != ",":
                text = text.replace(b",", b".")
            if self._separator is None:
                text = b"".join(b"\t".join(cells.split()) + b"\n" for cells in text.split(b"\n")[:-1])
            yield Block(first, lines, text)

    def _plain(self, block: Block, places: list[int]) -> list[Array] | None:
        """Return columns of a block in which every line is a row; None for any other."""
        if _has_marks(block.text):
            return None
        width = block.text[: block.text.find(b"\n")].count(self._mark) + 1
        marks = Marks(block.text, self._mark, width)
        if width < self._width or not marks.is_plain:
            return None
        for place in range(self._width, width):
            start, end = marks.cells(place)
            if (start < end).any():
                return None
        columns = []
        for place in places:
            doubles, integers, is_read, are_integers = marks.numbers(place)
            if not is_read.all():
                start, end = marks.cells(place)
                for row in np.flatnonzero(~is_read):
                    number = _number(marks.text(start[row], end[row]))
                    if number is None:
                        return None
                    doubles[row] = number
            columns.append(integers if are_integers and is_read.all() else doubles)
        return columns

    def _by_arrow(self, block: Block, places: list[int], stores: list[Columns]) -> list[Array] | None:
        """Return columns of a block of plain rows whose cells are as those before; None for any other."""
        if _arrow() is None or _has_marks(block.text):
            return None
        names = [str(place) for place in range(self._width)]
        kinds = {
            names[place]: "int64" if store.is_integer else "float64"
            for place, store in zip(places, stores, strict=True)
        }
        try:
            table = _arrow().read_csv(
                io.BytesIO(block.text),
                _arrow().ReadOptions(column_names=names, use_threads=False, block_size=len(block.text) + 1),
                _arrow().ParseOptions(delimiter=self._mark.decode(), quote_char=False),
                _arrow().ConvertOptions(column_types=kinds, include_columns=[*kinds], null_values=[]),
            )
        except ValueError:  # a cell that is no number, or a row of another length
            return None
        return None if table.num_rows != block.lines else [table[names[place]].to_numpy() for place in places]

    def _one_by_one(self, blocks: Iterable[Block], places: list[int]) -> tuple[list[int], list[Array]]:
        """Return columns of rows that are not all plain, and their lines; refuse the first that is no row."""
        lines: list[int] = []
        columns: list[list[int | float]] = [[] for _ in places]
        for line, row in csv_rows(self.path, blocks, self._mark.decode()):
            if row[0].lstrip().startswith(_COMMENTS):
                continue
            where = f"{self.path}, line {line}"
            if len(row) < self._width or any(cell.strip() for cell in row[self._width :]):
                comma = self._separator == "," and len(row) > self._width
                raise InputError(
                    f"{where}: {counted(len(row), 'column')}; {self._width} are needed"
                    + ("; is the comma a decimal one?" if comma else "")
                )
            for place, column in zip(places, columns, strict=True):
                number = _number(row[place])
                if number is None:
                    raise InputError(
                        f"{where}: column {place + 1} is {row[place].strip()!r}; a finite number is needed"
                    )
                column.append(number)
            lines.append(line)
        kinds = [
            np.int64 if all(isinstance(number, int) for number in column) else float for column in columns
        ]
        return lines, [np.array(column, kind) for column, kind in zip(columns, kinds, strict=True)]


def _number(cell: str) -> int | float | None:
    """Return the number of a cell, nan if it has no value, and None if it holds anything else."""
    text = cell.strip()
    number = checks.double(text)
    if math.isnan(number):
        return number if text.lower() in _MISSING else None
    return int(text) if _INTEGER.fullmatch(text) and abs(int(text)) < 2**63 else number


@cache
def _arrow() -> Any:
    """Return the reader of pyarrow, which is faster than numpy, where it is installed."""
    try:
        return import_module("pyarrow.csv")
    except ImportError:
        return None


def _has_marks(text: bytes) -> bool:
    """Return whether there are cells in quotation marks or comments; a single character is looked for fast."""
    return b'"' in text or any(
        mark[:1] in text and (text.startswith(mark) or b"\n" + mark in text) for mark in _COMMENT_BYTES
    )


def _separator(sample: list[str]) -> str | None:
    """Return what splits lines into rows of equally many cells, most of them numbers."""
    lines = [line for line in sample if line.strip() and not line.lstrip().startswith(_COMMENTS)]

    def share(mark: str | None) -> tuple[float, bool]:
        rows = [_cells(line, mark) for line in lines]
        width = max(Counter(map(len, rows)).items(), key=lambda item: item[1], default=(0, 0))[0]
        cells = sum(map(len, rows))
        numbers = sum(_resembles_number(cell) for row in rows if len(row) == width > 1 for cell in row)
        return numbers / max(cells, 1), bool(rows) and len(rows[0]) > 1

    return max(_SEPARATORS, key=share)


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    cells = next(csv.reader([line], delimiter=separator), [])
    return cells[:-1] if len(cells) > 1 and not cells[-1].strip() else cells


def _resembles_number(cell: str) -> bool:
    """Return whether a cell is data: 1_0 is refused as a number, not skipped as a header."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _are_units(cells: list[str]) -> bool:
    """Return whether a row below the header states units."""
    known = {*units.RATES, *units.TIMES, *units.FORCES}
    stated = [units.spelled(cell.strip("[]() ")) for cell in cells]
    return not known.isdisjoint(stated) and not any(map(_resembles_number, cells))


def line_blocks(path: Path) -> Iterator[Block]:
    """Yield the lines of a file in blocks."""
    count, rest = 0, b""
    try:
        with _opened(path) as file:
            while True:
                chunk = file.read(_BLOCK)
                rest += chunk
                held = rest[-1:] if chunk and rest.endswith(b"\r") else b""
                lines = rest[: len(rest) - len(held)]
                if b"\r" in lines:
                    lines = lines.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
                if not count:
                    lines = lines.removeprefix(b"\xef\xbb\xbf")
                if b"\0" in lines:
                    raise _no_table(path, "it holds zero bytes")
                end = lines.rfind(b"\n") + 1
                if not chunk and len(lines) > end:
                    lines += b"\n"
                    end = len(lines)
                block, rest = lines[:end], lines[end:] + held
                _require_short(path, lines, count)
                number = block.count(b"\n")
                count += number
                if count > MOST_ROWS:
                    raise InputError(f"{path} has over {MOST_ROWS} lines; that is too many")
                if block:
                    yield Block(count - number + 1, number, block)
                if not chunk:
                    return
    except (OSError, EOFError, zlib.error, lzma.LZMAError) as error:
        raise InputError(f"{path} cannot be read ({getattr(error, 'strerror', None) or error})") from None


def _require_short(path: Path, lines: bytes, before: int) -> None:
    """Refuse a line that is too long: between two line feeds far apart a stretch of half the distance has none."""
    half = MOST_CHARACTERS // 2
    if all(lines.find(b"\n", first, first + half) >= 0 for first in range(0, len(lines) - half, half)):
        return
    sizes = [*map(len, lines.split(b"\n"))]
    if max(sizes) > MOST_CHARACTERS:
        number = before + 1 + next(k for k, size in enumerate(sizes) if size > MOST_CHARACTERS)
        raise InputError(f"{path}, line {number}: over {MOST_CHARACTERS} characters, which no line may have")


def _opened(path: Path) -> IO[bytes]:
    """Open a file for reading bytes, which are compressed or not."""
    file = streams.opened(path)
    head = file.read(6)
    file.seek(0)
    for magic, opened in _COMPRESSED.items():
        if head.startswith(magic):
            return cast(IO[bytes], opened(file))
    if head.startswith(_ZSTANDARD):
        try:
            from compression import zstd  # type: ignore[import-not-found]  # of Python 3.14
        except ImportError:
            raise InputError(
                f"{path} is compressed by zstd, which Python reads from 3.14 on; zstd -d expands it"
            ) from None
        return cast(IO[bytes], zstd.open(file))
    return file


def _decoded(block: bytes) -> str:
    try:
        return block.decode()
    except UnicodeDecodeError:
        return block.decode("latin-1")  # as a degree sign in a header


def csv_rows(path: Path, blocks: Iterable[Block], separator: str = ",") -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each row with the number of the line at which it ends."""
    first = 1

    def lines() -> Iterator[str]:
        nonlocal first
        for place, block in enumerate(blocks):
            first = first if place else block.first
            yield from io.StringIO(_decoded(block.text))

    reader = csv.reader(lines(), delimiter=separator)
    try:
        for row in reader:
            if len(row) > MOST_CELLS:
                raise _too_many_cells(path, first - 1 + reader.line_num, len(row))
            # A blank line is skipped, but a row of empty cells lacks its data.
            if len(row) > 1 or any(cell.strip() for cell in row):
                yield first - 1 + reader.line_num, row
    except csv.Error as error:
        raise _no_table(path, error) from None


def _too_many_cells(path: Path, line: int, count: int) -> InputError:
    return InputError(f"{path}, line {line}: {count} cells; at most {MOST_CELLS} are allowed")


def _no_table(path: Path, error: object) -> InputError:
    return InputError(f"{path} is no text file of comma-separated values ({error})")
