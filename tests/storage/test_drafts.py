"""Draft folders: the next process removes those of processes that are gone, and no others."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from strapgen.storage import drafts

HOLDING = """
import sys, time
from pathlib import Path
from strapgen.storage import drafts
with drafts.draft_folder(Path(sys.argv[1]), ".draft-") as place:
    (place / "half").write_text("x")
    print(place, flush=True)
    sys.stdin.read()
"""


def holding(folder: Path) -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    return process, Path(process.stdout.readline().strip())


def test_a_draft_is_private_and_gone_after_the_block(tmp_path):
    with drafts.draft_folder(tmp_path, ".draft-") as place:
        assert place.parent == tmp_path
        assert place.stat().st_mode & 0o777 == 0o700
    assert list(tmp_path.iterdir()) == []


def test_what_is_renamed_stays(tmp_path):
    with drafts.draft_folder(tmp_path, ".draft-") as place:
        (place / "file").write_text("x")
        place.rename(tmp_path / "whole")
    assert (tmp_path / "whole" / "file").read_text() == "x"


def test_the_draft_of_a_process_at_work_is_not_forgotten_until_it_is_killed(tmp_path):
    process, place = holding(tmp_path)
    os.utime(place, (0, 0))  # the clock says nothing
    assert list(drafts.forgotten(tmp_path, ".draft-")) == []
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert list(drafts.forgotten(tmp_path, ".draft-")) == [place]


def test_one_process_at_a_time_has_a_forgotten_draft(tmp_path):
    (tmp_path / ".draft-01234567").mkdir()
    for _ in drafts.forgotten(tmp_path, ".draft-"):
        assert list(drafts.forgotten(tmp_path, ".draft-")) == []
    assert len(list(drafts.forgotten(tmp_path, ".draft-"))) == 1


def test_other_names_files_and_links_are_no_drafts(tmp_path):
    for name in (
        ".draft-0123456",
        ".draft-012345678",
        ".draft-0123456G",
        "x.draft-01234567",
        ".Draft-01234567",
    ):
        (tmp_path / name).mkdir()
    (tmp_path / ".draft-00000000").write_text("a file")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / ".draft-00000001").symlink_to("elsewhere")
    assert list(drafts.forgotten(tmp_path, ".draft-")) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only the administrator gives files to other users")
def test_drafts_of_other_users_are_left_alone(tmp_path):
    (tmp_path / ".draft-01234567").mkdir()
    os.chown(tmp_path / ".draft-01234567", 65534, -1)
    assert list(drafts.forgotten(tmp_path, ".draft-")) == []


@pytest.mark.parametrize(("age", "is_forgotten"), [(10, False), (7200, True), (-7200, True)])
def test_where_there_are_no_locks_age_decides(tmp_path, monkeypatch, age, is_forgotten):
    place = tmp_path / ".draft-01234567"
    place.mkdir()
    then = place.stat().st_mtime - age
    os.utime(place, (then, then))
    monkeypatch.setattr(drafts, "fcntl", None)
    assert bool(list(drafts.forgotten(tmp_path, ".draft-"))) is is_forgotten
    with drafts.draft_folder(tmp_path, ".draft-") as mine:
        assert mine.is_dir()
    assert not mine.exists()


def test_a_draft_that_another_process_takes_at_once_is_made_again(tmp_path, monkeypatch):
    locked, answers = drafts._locked, [None, None]
    monkeypatch.setattr(drafts, "_locked", lambda place: answers.pop() if answers else locked(place))
    with drafts.draft_folder(tmp_path, ".draft-") as place:
        assert list(tmp_path.iterdir()) == [place]


def test_a_temporary_folder_of_a_killed_process_is_removed_by_the_next_one(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "strapgen-work-01234567" / "deep").mkdir(parents=True)
    (tmp_path / "strapgen-work-mine").mkdir()
    with drafts.temporary_folder() as place:
        assert sorted(tmp_path.iterdir()) == sorted([place, tmp_path / "strapgen-work-mine"])
        with drafts.temporary_folder() as other:
            assert place.is_dir() and other != place
    assert list(tmp_path.iterdir()) == [tmp_path / "strapgen-work-mine"]


def test_a_busy_folder_is_an_error_and_no_endless_loop(tmp_path, monkeypatch):
    monkeypatch.setattr(drafts, "_locked", lambda _: None)
    with pytest.raises(OSError, match="busy"), drafts.draft_folder(tmp_path, ".draft-"):
        raise AssertionError
    assert list(tmp_path.iterdir()) == []


FORKING = """
import os, sys
from pathlib import Path
from strapgen.storage import drafts
with drafts.draft_folder(Path(sys.argv[1]), ".draft-") as place:
    if os.fork() == 0:
        raise SystemExit  # leaves the block, as the end of a program does
    os.wait()
    assert place.is_dir()
assert not place.exists()
"""


def test_a_forked_process_leaves_the_folder_to_its_owner(tmp_path):
    done = subprocess.run([sys.executable, "-c", FORKING, str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
