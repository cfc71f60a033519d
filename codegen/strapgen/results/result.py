"""Results of commands in every format, each written only when it is asked for, with their JSON Schemas and plots."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from strapgen import registration
from strapgen.ir.exceptions import InputError
from strapgen.results.records import Record, keyed_table, plain_record, record_schema
from strapgen.results.table import TextTable


class Result(Record):
    """The result of a command: a dataclass whose fields are the JSON, and whose rows are the tables.

    A subclass is registered by its folder under the name that its JSON and `strapgen schema` have.
    """

    #: The dataclass of the rows, if JSON is the list of these
    row: ClassVar[type | None] = None
    #: The dataclass of each, if the command answers for several algorithms or targets: JSON has their list under
    #: the key results, and beside it the keys of the first where it is alone
    each: ClassVar[type | None] = None
    #: The field that has the rows; "" for a result without tables, or one that has a method for them
    rows_in: ClassVar[str] = ""
    #: The function "module:name" of a result and a file that returns the image; "" for none
    drawn_by: ClassVar[str] = ""
    #: Whether JSON has a line for each part
    indented: ClassVar[bool] = True

    def text(self) -> str:
        """Return the result for a reader."""
        return self.reader().as_text()

    def __str__(self) -> str:
        return self.text()

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """Show the text at the prompt of IPython."""
        printer.text(self.text())

    def rows(self) -> Any:
        """Return the sequence of the records of its tables; None if it has no tables."""
        return getattr(self, self.rows_in) if self.rows_in else None

    def results(self) -> Sequence[Any]:
        """Return the records of a result with `each`."""
        raise NotImplementedError

    def table(self) -> TextTable:
        """Return the rows as a table for programs."""
        return keyed_table(self.rows())

    def reader(self) -> TextTable:
        """Return the rows as a table for readers, for Markdown and LaTeX."""
        return self.table()

    def latex(self) -> str | None:
        """Return the result in LaTeX."""
        return None if self.rows() is None else self.reader().as_latex()

    def data(self) -> Any:
        """Return the result as plain JSON data, with the name of its schema."""
        mark = {"schema": identifier(name)} if (name := name_of(type(self))) else {}
        if self.row is not None:
            return [mark | plain_record(row) for row in self.rows()]
        if self.each is None:
            return mark | plain_record(self)
        results = [plain_record(one) for one in self.results()]
        return mark | (results[0] if len(results) == 1 else {}) | {"results": results}

    def written(self, format: str) -> str:
        """Return the result as "text", "json", "csv", "markdown" or "latex"."""
        if format == "text":
            return self.text()
        if format == "json":
            return as_json(self.data(), self.indented)
        has_table = self.rows() is not None
        if format == "csv" and has_table:
            return self.table().as_csv()
        if format == "markdown" and has_table:
            return self.reader().as_markdown()
        text = self.latex()
        if format == "latex" and text is not None:
            return text
        tables = ("csv", "markdown") if has_table else ()
        allowed = ("text", "json", *tables, *(("latex",) if text is not None else ()))
        raise InputError(f"this result is not written as {format}; allowed: {', '.join(allowed)}")

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON Schema of the result."""
        name = name_of(cls)
        one = record_schema(cls.row or cls.each or cls)
        if cls.each is not None:
            results = {"results": {"title": "results", "type": "array", "items": one}}
            one = one | {"properties": one["properties"] | results, "required": ["results"]}
        one["properties"] = {"schema": {"title": "schema", "const": identifier(name)}} | one["properties"]
        one["required"] = ["schema", *one["required"]]
        title = (cls.__doc__ or "").partition("\n")[0].rstrip(".")
        head = {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "$id": identifier(name),
            "title": title,
        }
        return head | (one if cls.row is None else {"type": "array", "items": one})


def plot(result: Result, path: str | Path) -> bytes:
    """Return the image of a result, of the kind of the file's ending."""
    if not result.drawn_by:
        raise InputError(f"plot {path}: this result has no plot")
    image: bytes = registration.load(result.drawn_by)(result, path)
    return image


def as_json(data: Any, indented: bool = True) -> str:
    """Return data as JSON: a list on one line, an object with a line for each of its parts."""
    return json.dumps(data, indent=1 if indented and not isinstance(data, list) else None)


# Names


def identifier(name: str) -> str:
    """Return how JSON names the schema of a result."""
    return f"strapgen/{name}/1"


def name_of(kind: type) -> str:
    """Return the name under which a result is registered; "" for none."""
    place = f"{kind.__module__}:{kind.__qualname__}"
    return next((name for name, one in registration.schemas().items() if one.place == place), "")
