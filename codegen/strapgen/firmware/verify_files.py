"""Verifies the generated C among files and folders, for hooks: ``python -m strapgen.firmware.verify_files PATH...``.

Words that begin with ``-`` are options of ``strapgen verify``, such as ``--algorithm=own.py``. Files that strapgen has
not generated are left alone. The exit status is 1 if a file fails, and 2 if one cannot be read.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from strapgen.cli import program, terminal
from strapgen.firmware.header_command import COMMANDS
from strapgen.firmware.verification import beside, is_beside, whole_header
from strapgen.ir.exceptions import StrapgenError
from strapgen.run.standard_tree import command_of, text_of


def main(words: Sequence[str]) -> int:
    """Verify files, print what is wrong, and return the exit status."""
    options = [word for word in words if word.startswith("-")]
    worst = 0
    headers = list(dict.fromkeys(_headers(Path(word) for word in words if not word.startswith("-"))))
    parts = {part for header in headers if whole_header(header) for part in _parts(header)}
    for header in headers:
        if header in parts:  # verified with its whole
            continue
        try:
            status = int(program.run(["verify", str(header), *options]) or 0)
        except StrapgenError as error:
            terminal.write(f"strapgen: {header}: {error}", err=True)
            status = 2
        worst = max(worst, status)
    return worst


def _headers(places: Iterable[Path]) -> Iterator[Path]:
    """Yield the headers of the generated functions and wholes among files and in folders."""
    for place in places:
        inside = sorted(path for path in place.rglob("*") if path.is_file()) if place.is_dir() else [place]
        for path in inside:
            header = beside(path.parent, f"{path.stem}.h")
            if path.suffix in (".c", ".h") and header.is_file() and _is_generated(header):
                yield header
            elif path.suffix == ".hpp" and whole_header(path):
                yield path


def _parts(header: Path) -> Iterator[Path]:
    """Yield the headers of the functions that a whole calls."""
    texts = [text_of(path) for path in (header, beside(header.parent, f"{header.stem}.c")) if path.is_file()]
    for name in re.findall(r'^#include "(.*)"', "\n".join(texts), re.MULTILINE):
        if name != header.name:
            yield beside(header.parent, name)


def _is_generated(header: Path) -> bool:
    command = command_of(text_of(header)) or ""
    return command.startswith(tuple(f"strapgen {name} " for name in COMMANDS)) and not is_beside(command)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
