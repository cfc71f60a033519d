"""The statements of the thesis's text, with the runs that hold them against numbers, as a result."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable
from strapgen.thesis.thesis_statements import Statement

#: Width of the text in characters.
_WIDTH = 100


@dataclass(frozen=True)
class StatementsResult(Result):
    """What the text of the thesis says, and what runs say of it: a row for each statement."""

    rows_in = "statements"
    row = Statement

    statements: Sequence[Statement]

    def reader(self) -> TextTable:
        """Return the statements in words."""
        return reader_table(self.statements, Statement)

    def text(self) -> str:
        """Return what is said, what runs measure, and the verdict."""
        lines: list[str] = []
        for each in self.statements:
            verdict = each.verdict if each.confirmed else f"{each.verdict} (the runs do not bear this out)"
            lines += textwrap.wrap(
                f"{each.number}. {each.said}", _WIDTH, subsequent_indent=" " * len(f"{each.number}. ")
            )
            for what, text in (("run", each.run), ("verdict", verdict)):
                lines += textwrap.wrap(
                    f"{what}: {text}", _WIDTH, initial_indent="    ", subsequent_indent="      "
                )
            lines.append("")
        return "\n".join(lines).rstrip()
