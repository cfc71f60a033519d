"""Progress is for a person who watches, and for what takes time."""

from __future__ import annotations

import io
import re
import sys
import time

import pytest
from commands import run

from strapgen.cli import progress
from strapgen.cli.options import MethodOptions


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a moment short."""
    monkeypatch.setattr(progress, "_PATIENCE", 0.02)
    monkeypatch.setattr(progress, "_INTERVAL", 0.02)


def wait_for(stream: io.StringIO, text: str) -> None:
    """Wait until a text has been written; the test's own time limit ends it otherwise."""
    for _ in range(3000):
        if text in stream.getvalue():
            return
        time.sleep(0.01)
    raise AssertionError(f"{text!r} was never written")


def test_what_takes_time_is_shown_and_wiped_away(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with progress.waiting("deriving own.py"):
        wait_for(stream, "deriving own.py 0 s")
    assert stream.getvalue().endswith("\r\x1b[2K")


@pytest.mark.parametrize("stream", [Terminal(), io.StringIO()])
def test_it_is_quiet_when_fast_or_when_nobody_watches(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    # However busy the machine is, an hour is not over.
    monkeypatch.setattr(progress, "_PATIENCE", 3600.0 if stream.isatty() else 0.0)
    with progress.waiting("deriving own.py"):
        pass
    assert stream.getvalue() == ""


def test_an_error_ends_it(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with pytest.raises(ZeroDivisionError), progress.waiting("deriving own.py"):
        wait_for(stream, "deriving")
        raise ZeroDivisionError
    assert stream.getvalue().endswith("\r\x1b[2K")


def test_a_file_that_takes_its_time_shows_that_it_is_derived(tmp_path, impatient, monkeypatch):
    path = tmp_path / "slow.py"
    path.write_text("def algorithm():\n    import time; time.sleep(0.5)\n    return 3\n")
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with pytest.raises(ValueError, match=r"returned int; a Kernel is needed"):
        MethodOptions().choose(str(path))
    assert re.search(r"deriving \S*slow\.py \d s", stream.getvalue())


def test_reading_and_running_a_recording_are_shown(impatient, monkeypatch, tmp_path, capsys):
    from strapgen.lab.recordings import recording

    (tmp_path / "log.csv").write_text("".join(f"{k / 10},0,0,0\n" for k in range(4)))
    stream = Terminal()

    def slowly(function, text):
        def wait(*arguments):
            wait_for(stream, text)
            return function(*arguments)

        return wait

    monkeypatch.setattr(sys, "stderr", stream)
    for name, text in (("read_increments", "reading log.csv"), ("propagate", "running euler-rk4-2")):
        monkeypatch.setattr(recording, name, slowly(getattr(recording, name), text))
    run(["simulate", "euler", "--increments-csv", str(tmp_path / "log.csv")])
    assert stream.getvalue().endswith("\r\x1b[2K")
