"""Reads text files of comma-separated values row by row, within bounds, and never the whole of one."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from strapgen.ir.exceptions import InputError

#: Most rows of a file, characters of a line and cells of a row. An hour at 10 kHz has 36 million rows.
MOST_ROWS, MOST_CHARACTERS, MOST_CELLS = 50_000_000, 20_000, 1_000
#: Lines that are handed out together.
_BLOCK = 1 << 13


def blocks(path: Path) -> Iterator[list[str]]:
    """Yield the lines of a file, some thousands at a time."""
    count = 0
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
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


def rows(
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
