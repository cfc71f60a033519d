"""Reports the names of the catalogue with what they mean."""

from __future__ import annotations

from collections.abc import Mapping

from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_COLUMNS = (Column("name", "<"), Column("meaning", "<"))
_Meanings = Mapping[str, str]


def names_report(kinds: Mapping[str, _Meanings], short: Mapping[str, _Meanings], every: bool) -> Report:
    """Return names with their meanings, by kind, as a report; `short` for its text, `every` if these are all kinds."""

    def text() -> str:
        width = max(len(name) for part in short.values() for name in part)
        columns = (Column(align="<", least=width), Column(align="<"))
        lines = []
        for kind, part in short.items():
            lines += [kind] if every else []
            lines += TextTable(columns, list(part.items())).lines("  " if every else "")
        return "\n".join(lines)

    def table() -> TextTable:
        if every:
            rows = [(kind, *item) for kind, part in kinds.items() for item in part.items()]
            return TextTable([Column("kind", "<"), *_COLUMNS], rows)
        return TextTable(_COLUMNS, [item for part in kinds.values() for item in part.items()])

    return Report(text, lambda: dict(kinds), table)
