"""Commands of strapgen, run in this process."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from strapgen.cli import main


def run(words: Sequence[str], status: int = 0) -> None:
    """Run a command, which ends with an exit status; `capsys` has what it prints."""
    with pytest.raises(SystemExit) as stop:
        main([*words])
    assert (stop.value.code or 0) == status
