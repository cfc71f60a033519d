"""The script that kills, fills disks and moves clocks: it runs, and it would notice."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import faults
import pytest

pytestmark = pytest.mark.posix


@pytest.fixture
def place(tmp_path: Path) -> faults.Place:
    return faults.Place(tmp_path)


@pytest.fixture
def trials(tmp_path: Path) -> faults.Trials:
    trials = faults.Trials(tmp_path, 0, 0.0)
    trials.references["x"] = faults.Reference(faults.Result(0, "out", ""), {"a.c": "new"}, 1.0, tmp_path)
    return trials


def entry(place: faults.Place, files: dict[str, str], listed: list[str]) -> None:
    folder = place.root / "cache" / "kind" / "key"
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "manifest.json").write_text(json.dumps(dict.fromkeys(listed, "hash")))


@pytest.mark.parametrize(
    ("files", "listed", "is_whole"),
    [
        ({"a": "x"}, ["a"], True),
        ({}, ["a"], False),
        ({"a": ""}, ["a"], False),
        ({"a": "x", "b": "x"}, ["a"], False),
    ],
)
def test_an_entry_that_is_not_whole_is_noticed(place, files, listed, is_whole):
    entry(place, files, listed)
    assert place.left() == ([] if is_whole else ["cache/kind/key"])


@pytest.mark.parametrize(
    "name", ["out/.strapgen-draft-01234567", "cache/kind/.filling-01234567", "tmp/anything"]
)
def test_leftover_files_are_noticed(place, name):
    (place.root / name).mkdir(parents=True)
    assert name in place.left()


@pytest.mark.parametrize(("text", "is_wrong"), [("old", False), ("new", False), ("ne", True), ("", True)])
def test_half_a_file_is_noticed(trials, place, text, is_wrong):
    (place.root / "out" / "a.c").write_text(text)
    assert bool(trials.halves("x", place, {"a.c": "old"})) is is_wrong


@pytest.mark.parametrize(
    ("result", "text", "is_wrong"),
    [
        (faults.Result(0, "out", ""), "new", False),
        (faults.Result(0, "out", ""), "old", True),
        (faults.Result(0, "other", ""), "new", True),
        (faults.Result(2, "", "strapgen: the disk is full\n"), "old", False),
        (faults.Result(2, "", "strapgen: the disk is full\n"), "ol", True),
        (faults.Result(2, "", "strapgen: one\nand two\n"), "old", True),
        (faults.Result(1, "", "Traceback\n"), "old", True),
    ],
)
def test_a_run_does_its_work_or_says_why_not(trials, place, result, text, is_wrong):
    (place.root / "out" / "a.c").write_text(text)
    assert bool(faults.refused_or_right(trials, "x", place, result, {"a.c": "old"})) is is_wrong


def test_running_process_is_noticed_and_ended(monkeypatch):
    monkeypatch.setattr(faults, "ORPHANS_S", 0.1)
    code = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])"
    process = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    process.wait()
    (said,) = faults.outlived(process.pid)
    assert "time.sleep(600)" in said
    for _ in range(500):
        if not faults.members(process.pid):
            break
        time.sleep(0.02)
    assert faults.outlived(process.pid) == []


def test_the_plan_has_every_kind_on_every_command():
    planned = faults.plan(1, [*faults.KINDS], [*faults.COMMANDS])
    counts = Counter((kind, command) for kind, command, _ in planned)
    assert counts.keys() == {(kind, command) for kind in faults.KINDS for command in faults.COMMANDS}
    assert sum(count for (kind, _), count in counts.items() if kind == "killed") == 100
    assert (
        planned
        == faults.plan(1, [*faults.KINDS], [*faults.COMMANDS])
        != faults.plan(2, [*faults.KINDS], [*faults.COMMANDS])
    )


@pytest.mark.long
def test_some_kills_leave_nothing(tmp_path):
    words = ["--trials", "4", "--kind", "killed", "--command", "generate --all"]
    command = [sys.executable, faults.__file__, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 of 4 trials, 0 faults left something wrong" in done.stdout
