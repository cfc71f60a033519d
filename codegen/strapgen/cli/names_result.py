"""Names with their meanings as a result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable


@dataclass(frozen=True)
class NamesResult(Result):
    """Names with their meanings, by kind."""

    kinds: Mapping[str, Mapping[str, str]] = field(metadata=entry(spread=True))
    #: The same with series of names on one line, for the text
    short: Mapping[str, Mapping[str, str]] = field(metadata=INTERNAL)
    #: Whether these are all kinds
    every: bool = field(metadata=INTERNAL)

    def rows(self) -> list[tuple[str, ...]]:
        """Return names with meanings, after the kind if there are several."""
        return [
            (*([kind] if self.every else []), *item)
            for kind, part in self.kinds.items()
            for item in part.items()
        ]

    def table(self) -> TextTable:
        """Return the names as a table."""
        names = [*(["kind"] if self.every else []), "name", "meaning"]
        return TextTable([Column(name, "<") for name in names], self.rows())

    def text(self) -> str:
        """Return the names of each kind."""
        width = max(len(name) for part in self.short.values() for name in part)
        columns = (Column(align="<", least=width), Column(align="<"))
        lines = []
        for kind, part in self.short.items():
            lines += [kind] if self.every else []
            lines += TextTable(columns, list(part.items())).lines("  " if self.every else "")
        return "\n".join(lines)
