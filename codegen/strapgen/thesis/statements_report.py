"""Reports the statements of the thesis's text, with the runs that hold them against numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from strapgen.results.report import Report, flat_table
from strapgen.results.table import Column, TextTable
from strapgen.thesis.thesis_statements import Statement

#: Width of the text in characters.
_WIDTH = 100


def statements_text(statements: Sequence[Statement]) -> str:
    """Return statements as text: what is said, what runs measure, and the verdict."""
    lines: list[str] = []
    for each in statements:
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


def statements_report(statements: Sequence[Statement]) -> Report:
    """Return statements as a report."""
    data = [each.as_dict() for each in statements]

    def markdown() -> TextTable:
        columns = [Column(name, "<") for name in ("statement of the text", "run", "verdict")]
        return TextTable(columns, [[each.said, each.run, each.verdict] for each in statements])

    return Report(lambda: statements_text(statements), lambda: data, lambda: flat_table(data), markdown)
