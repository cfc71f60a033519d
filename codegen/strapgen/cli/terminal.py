"""Output of commands: results with verdicts in colour on a terminal, and remarks on stderr unless --quiet."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from typing import TextIO

import typer

#: Verdicts where commands state them: first in a line, or of files after a comma or "is".
_VERDICT = re.compile(
    r"^(?P<space> {0,2})(?P<first>ok|holds|FAILS)(?= )|(?<=, )(?:in|out of) step\b|(?<= is )(?:in|out of) step\b",
    re.MULTILINE,
)
_GOOD = ("ok", "holds", "in step")
_GREEN, _RED, _PLAIN = "\x1b[32m", "\x1b[1;31m", "\x1b[0m"
_quiet = False


def silence() -> Callable[[], None]:
    """Leave out remarks and progress; the function that is returned ends that."""
    global _quiet
    before, _quiet = _quiet, True

    def end() -> None:
        global _quiet
        _quiet = before

    return end


def is_quiet() -> bool:
    """Return whether remarks and progress are left out."""
    return _quiet


def is_coloured(stream: TextIO) -> bool:
    """Return whether a stream takes colour: a terminal does, unless NO_COLOR is set; any does with FORCE_COLOR."""
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def write(text: str, *, err: bool = False) -> None:
    """Write a result in lines, or an error where `err` says so, with its verdicts in colour on a terminal."""
    coloured = is_coloured(sys.stderr if err else sys.stdout)
    typer.echo(_VERDICT.sub(_in_colour, text) if coloured else text, err=err, color=coloured or None)


def remark(text: str) -> None:
    """Write a remark on stderr."""
    if not _quiet:
        write(text, err=True)


def _in_colour(found: re.Match[str]) -> str:
    space, word = found["space"] or "", found["first"] or found[0]
    return f"{space}{_GREEN if word in _GOOD else _RED}{word}{_PLAIN}"
