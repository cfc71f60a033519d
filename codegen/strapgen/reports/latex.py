"""Functions that write LaTeX for several reports."""

from __future__ import annotations

from collections.abc import Iterable


def align_environment(rows: Iterable[str]) -> str:
    """Return rows as one align environment of the package amsmath; each has its & before the relation."""
    body = " \\\\\n".join(rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def wrapped(text: str, terms: int = 4) -> str:
    """Break a long sum of an align environment into lines."""
    parts = text.replace(" + ", "\n+ ").replace(" - ", "\n- ").split("\n")
    lines = [" ".join(parts[k : k + terms]) for k in range(0, len(parts), terms)]
    return " \\\\\n    &\\quad ".join(lines)
