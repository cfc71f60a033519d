"""What is on the terminal: colour of verdicts, remarks that --quiet leaves out, lines of progress, first steps."""

import io
import re
import shlex
import sys
import threading
import time

import pytest

from strapgen.cli import help_layout, main, progress, terminal


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _no_variables(monkeypatch):
    for name in ("NO_COLOR", "FORCE_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)


def run(*words: str) -> int:
    """Run a command line, and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        main([*words])
    return int(stop.value.code or 0)


GREEN, RED = "\x1b[32m{}\x1b[0m", "\x1b[1;31m{}\x1b[0m"


@pytest.mark.parametrize(
    ("text", "word", "style"),
    [
        ("ok    slow: strapgen generate dcm", "ok", GREEN),
        ("FAILS slow: strapgen generate dcm", "FAILS", RED),
        ("  holds  order  4 of 4", "holds", GREEN),
        ("title\n  FAILS  order  3 of 4", "FAILS", RED),
        ("firmware: 2 files, in step", "in step", GREEN),
        ("a.h: 2 files, out of step with the command", "out of step", RED),
        ("strapgen: firmware is out of step; again", "out of step", RED),
    ],
)
def test_a_verdict_has_its_colour(text, word, style, monkeypatch):
    monkeypatch.setattr(sys, "stdout", stream := Terminal())
    terminal.write(text)
    assert stream.getvalue() == f"{text.replace(word, style.format(word))}\n"


@pytest.mark.parametrize("text", ["the file holds 3 increments", "okay", "a step in steps", "holds-all x"])
def test_other_words_have_none(text, monkeypatch):
    monkeypatch.setattr(sys, "stdout", stream := Terminal())
    terminal.write(text)
    assert stream.getvalue() == f"{text}\n"


@pytest.mark.parametrize(
    ("stream", "variables", "coloured"),
    [
        (Terminal(), {}, True),
        (io.StringIO(), {}, False),
        (Terminal(), {"NO_COLOR": "1"}, False),
        (Terminal(), {"NO_COLOR": ""}, True),
        (Terminal(), {"TERM": "dumb"}, False),
        (io.StringIO(), {"FORCE_COLOR": "1"}, True),
        (Terminal(), {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_colour_is_for_terminals_and_for_who_forces_it(stream, variables, coloured, monkeypatch):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "stdout", stream)
    terminal.write("ok    all")
    assert ("\x1b" in stream.getvalue()) == coloured


def test_files_and_json_have_no_colour_on_a_terminal(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("generate", "dcm", "--target", "c", "--out", "made") == 0
    monkeypatch.setattr(sys, "stdout", stream := Terminal())
    assert run("generate", "dcm", "--target", "c", "--out", "made", "--check") == 0
    assert stream.getvalue() == f"made: 2 files, {GREEN.format('in step')}\n"
    assert run("verify", "made/dcm_rk4_2.c", "--out", "said.txt") == 0
    assert "in step" in (said := (tmp_path / "said.txt").read_text(encoding="utf-8")) and "\x1b" not in said


def test_quiet_leaves_out_remarks_and_keeps_errors(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("derive", "dcm", "--out", "said.txt") == 0
    assert capsys.readouterr().err == "wrote said.txt\n"
    assert run("--quiet", "derive", "dcm", "--out", "said.txt") == 0
    assert capsys.readouterr() == ("", "")
    assert run("--quiet", "derive", "nothing") == 2
    assert capsys.readouterr().err.startswith("strapgen: ")
    assert not terminal.is_quiet()


@pytest.mark.parametrize("stream", [Terminal(), io.StringIO()])
def test_quiet_shows_no_progress(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    for name in ("_PATIENCE", "_BETWEEN_LINES"):
        monkeypatch.setattr(progress, name, 0.0)
    end = terminal.silence()
    with progress.waiting("deriving"):
        assert list(progress.track(range(3), "running", 3)) == [0, 1, 2]
    end()
    assert stream.getvalue() == ""


def test_where_no_terminal_is_progress_is_in_lines(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := io.StringIO())
    monkeypatch.setattr(progress, "_BETWEEN_LINES", 0.02)
    items = progress.track("ab", "running", 2)
    assert next(items) == "a"
    while stream.getvalue().count("\n") < 2:  # during a step too, however long it takes
        time.sleep(0.01)
    assert set(stream.getvalue().splitlines()) == {"running: 0 of 2"}
    assert next(items) == "b"
    while "running: 1 of 2" not in stream.getvalue():
        time.sleep(0.01)
    assert list(items) == []


def test_progress_in_lines_ends_with_an_error(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    monkeypatch.setattr(progress, "_BETWEEN_LINES", 0.02)
    before = threading.active_count()
    items = progress.track((1 / number for number in (1, 0)), "running", 2)
    assert next(items) == 1
    with pytest.raises(ZeroDivisionError):
        next(items)
    assert threading.active_count() == before


def test_where_no_terminal_is_a_task_says_its_seconds_in_lines(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := io.StringIO())
    monkeypatch.setattr(progress, "_BETWEEN_LINES", 0.02)
    with progress.waiting("deriving own.py"):
        while stream.getvalue().count("\n") < 2:
            time.sleep(0.01)
    assert re.fullmatch(r"(deriving own\.py \d+ s\n)+", stream.getvalue())


def test_without_words_five_jobs_are_shown(capsys):
    assert run() == 0
    said = capsys.readouterr().out
    assert said == f"{help_layout.first_steps()}\n"
    assert [line.partition(":")[0] for line in said.splitlines() if ": " in line and line[0] != " "] == [
        *("derive", "generate", "simulate", "compare", "series")
    ]
    assert said.endswith("strapgen --help shows all commands and options.\n")


@pytest.mark.parametrize("job", help_layout._JOBS)
def test_the_command_of_a_job_runs(job, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = shlex.split(help_layout._JOBS[job][1])
    assert words[:2] == ["strapgen", job]
    assert run(*words[1:]) == 0
    assert capsys.readouterr().out


@pytest.mark.parametrize("words", [["compare"], ["study", "loops"], ["study"]])
def test_help_of_a_command_is_the_same_both_ways(words, capsys):
    assert run("help", *words) == 0
    shown = capsys.readouterr().out
    assert run(*words, "--help") == 0
    assert shown == capsys.readouterr().out and f"Usage: strapgen {' '.join(words)}" in shown


def test_the_version_has_a_short_name(capsys):
    assert run("-V") == 0
    shown = capsys.readouterr().out
    assert run("--version") == 0
    assert shown == capsys.readouterr().out and shown.startswith("strapgen ")
