"""Commands of strapgen, run in this process."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import pytest

from strapgen.cli import main


def run(words: Sequence[str], status: int = 0) -> None:
    """Run a command, which ends with an exit status; `capsys` has what it prints."""
    with pytest.raises(SystemExit) as stop:
        main([*words])
    assert (stop.value.code or 0) == status


def says(command: str | Sequence[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """Run a command, and return its exit status and what it prints on stdout and on stderr."""
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command) if isinstance(command, str) else [*command])
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err
