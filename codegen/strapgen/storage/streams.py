"""Files to read, of which - is standard input."""

from __future__ import annotations

import io
import os
import sys
from functools import cache
from pathlib import Path
from typing import BinaryIO

#: The path that stands for standard input, and where something is written for standard output.
STANDARD = Path("-")
_SEPARATORS = [mark for mark in (os.sep, os.altsep) if mark]


def opened(path: Path) -> BinaryIO:
    """Open a file for reading bytes; standard input may be opened several times, and is read once."""
    return io.BytesIO(_standard_input()) if path == STANDARD else path.open("rb")


@cache
def _standard_input() -> bytes:
    return b"" if sys.stdin is None else sys.stdin.buffer.read()


def names_file(text: str) -> bool:
    """Return whether an argument is a TOML file, and no name: it ends in .toml, has a path separator, or is -."""
    return text == str(STANDARD) or text.endswith(".toml") or any(mark in text for mark in _SEPARATORS)
