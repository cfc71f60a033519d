"""Lays out tables from columns that say how their cells are written, as text, comma-separated values or Markdown."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

#: How numbers of a kind are written: angles in deg or rad, errors, times and steps in s.
ANGLE, ERROR, SECONDS = ".3g", ".3e", ".6g"
#: For each unit of a mean rate the unit that a person reads, and the factor to it.
READABLE_UNITS = {"rad/s": ("deg/h", math.degrees(3600)), "m/s^2": ("micro-g", 1e6 / 9.80665)}


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    header : str, optional
        A table in which no column has a header has no line of headers.
    align : str, optional
        "<", ">" or "^".
    spec : str, optional
        Format of the cells that are no text.
    least : int, optional
        Least width in characters.
    gap : int, optional
        Spaces before the column.
    missing : str, optional
        What stands for None.
    group : str, optional
        Title above neighbouring columns of the same group: in their middle, or aligned as a column that stands alone.
    """

    header: str = ""
    align: str = ">"
    spec: str = ""
    least: int = 0
    gap: int = 2
    missing: str = "-"
    group: str = ""

    def cell(self, value: Any) -> str:
        """Return a value as it stands in the column."""
        if value is None:
            return self.missing
        return value if isinstance(value, str) else format(value, self.spec)


@dataclass(frozen=True)
class TextTable:
    """Rows of values under columns.

    Parameters
    ----------
    columns : sequence of Column
    rows : sequence of sequence
        A value for each column: text stays as it is, a number has the format of its column, None is missing.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]

    def lines(self, indent: str = "") -> list[str]:
        """Return the table as lines of text, each column as wide as its widest cell."""
        heads = [column.header for column in self.columns]
        cells = ([heads] if any(heads) else []) + self._cells()
        widths = [
            max([column.least, *(len(line[k]) for line in cells)]) for k, column in enumerate(self.columns)
        ]
        gaps = [" " * column.gap if k else indent for k, column in enumerate(self.columns)]
        titles = [self._titles(widths)] if any(column.group for column in self.columns) else []
        lines = [
            "".join(
                f"{gap}{cell:{column.align}{width}}"
                for gap, cell, column, width in zip(gaps, line, self.columns, widths, strict=True)
            )
            for line in cells
        ]
        return [line.rstrip() for line in [*(indent + title for title in titles), *lines]]

    def _cells(self) -> list[list[str]]:
        return [
            [column.cell(value) for column, value in zip(self.columns, row, strict=True)] for row in self.rows
        ]

    def _titles(self, widths: Sequence[int]) -> str:
        """Return the line of the titles of groups."""
        line = ""
        for group, members in groupby(range(len(widths)), key=lambda k: self.columns[k].group):
            first, *others = members
            width = widths[first] + sum(self.columns[k].gap + widths[k] for k in others)
            gap = " " * self.columns[first].gap if first else ""
            line += f"{gap}{group:{'^' if others else self.columns[first].align}{width}}"
        return line

    def as_text(self, indent: str = "") -> str:
        """Return the table as text for a reader, every line after an indent."""
        return "\n".join(self.lines(indent))

    def as_csv(self) -> str:
        """Return the table as comma-separated values under the headers: numbers in full, an empty cell for None."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(column.header for column in self.columns)
        writer.writerows(["" if value is None else value for value in row] for row in self.rows)
        return text.getvalue()

    def as_markdown(self) -> str:
        """Return the table in Markdown; a column's header has the title of its group before it."""
        rules = {"<": ":--", ">": "--:", "^": ":-:"}
        heads = [f"{column.group} {column.header}".strip() for column in self.columns]
        lines = [heads, [rules[column.align] for column in self.columns], *self._cells()]
        return "\n".join(
            "| " + " | ".join(cell.strip().replace("|", r"\|") for cell in line) + " |" for line in lines
        )
