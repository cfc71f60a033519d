"""Results in every format that a command offers, each written only when it is asked for."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.ir.exceptions import InputError
from strapgen.results.table import Column, TextTable

#: Digits of the numbers of a table in Markdown that states none.
_DIGITS = ".6g"


@dataclass(frozen=True)
class Report:
    """A result in every format."""

    text: Callable[[], str]
    data: Callable[[], Any]  # of plain JSON
    table: Callable[[], TextTable] | None = None  # for comma-separated values, and for Markdown
    markdown: Callable[[], TextTable] | None = None  # for Markdown, with the columns of the text
    latex: Callable[[], str] | None = None  # by default the table of Markdown, if there is one
    indented: bool = True  # whether an object of JSON has a line for each of its parts

    def written(self, format: str) -> str:
        """Return the result as "text", "json", "csv", "markdown" or "latex"."""
        table = self.markdown or self.table
        if format == "text":
            return self.text()
        if format == "json":
            return as_json(self.data(), self.indented)
        if format == "csv" and self.table is not None:
            return self.table().as_csv()
        if format == "markdown" and table is not None:
            return table().as_markdown()
        if format == "latex" and self.latex is not None:
            return self.latex()
        if format == "latex" and table is not None:
            return table().as_latex()
        raise InputError(f"this result is not written as {format}; allowed: {', '.join(self.formats)}")

    @property
    def formats(self) -> tuple[str, ...]:
        """The formats in which the result can be written."""
        tables = ("csv", "markdown", "latex") if self.table is not None else ()
        return tuple(
            dict.fromkeys(("text", "json", *tables, *(("latex",) if self.latex is not None else ())))
        )


def as_json(data: Any, indented: bool = True) -> str:
    """Return data as JSON: a list on one line, an object with a line for each of its parts."""
    return json.dumps(data, indent=1 if indented and not isinstance(data, list) else None)


def flat_table(rows: Sequence[Mapping[str, Any]]) -> TextTable:
    """Return objects of JSON as a table: a row for each, a column for each key."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    values = [[_cell(row.get(name)) for name in names] for row in rows]
    columns = []
    for place, name in enumerate(names):
        kinds = {type(row[place]) for row in values}
        columns.append(Column(name, "<" if str in kinds else ">", _DIGITS if float in kinds else ""))
    return TextTable(columns, values)


def _cell(value: Any) -> Any:
    """Return a value of JSON as one cell: the parts of an object or a list stand one after the other."""
    if isinstance(value, Mapping):
        return " ".join(f"{key}={part}" for key, part in value.items())
    return " ".join(map(str, value)) if isinstance(value, list | tuple) else value
