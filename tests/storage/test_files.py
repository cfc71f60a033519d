"""Writing files: all of them or none, whole, with ordinary permissions; and the folders where they are drafted."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.storage import drafts
from strapgen.storage.files import is_staged, write_file, write_files

FILES = {"a.txt": "alpha\n", "deep/er/b.txt": "beta\n", "c.bin": b"\x00\xff"}


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_files_are_written_in_order(tmp_path):
    written = write_files(tmp_path / "new", FILES)
    assert written == [tmp_path / "new" / name for name in FILES]
    assert tree(tmp_path / "new") == {"a.txt": b"alpha\n", "deep/er/b.txt": b"beta\n", "c.bin": b"\x00\xff"}


def test_text_is_utf8_with_line_feeds(tmp_path):
    assert write_file(tmp_path / "x", "σ\nτ\n").read_bytes() == "σ\nτ\n".encode()


def test_name_without_a_folder_goes_here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert write_file("x.txt", "x") == Path("x.txt")
    assert tree(tmp_path) == {"x.txt": b"x"}


def test_old_files_are_replaced_and_others_left(tmp_path):
    (tmp_path / "a.txt").write_text("old, and longer than the new")
    (tmp_path / "mine.txt").write_text("mine")
    write_files(tmp_path, FILES)
    assert tree(tmp_path)["a.txt"] == b"alpha\n"
    assert tree(tmp_path)["mine.txt"] == b"mine"


def disk_full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class FullDisk:
    """A disk that is full after so many files."""

    def __init__(self, files: int) -> None:
        self.left = files
        self.fdopen = os.fdopen

    def __call__(self, handle: int, mode: str):
        file = self.fdopen(handle, mode)
        if self.left == 0:
            file.write(b"hal")  # half of it gets there
            file.write = disk_full
        self.left -= 1
        return file


@pytest.mark.parametrize("fitting", [0, 1, 2])
def test_full_disk_changes_nothing(fitting, tmp_path, monkeypatch):
    write_files(tmp_path, FILES)
    before = tree(tmp_path)
    monkeypatch.setattr(os, "fdopen", FullDisk(fitting))
    with pytest.raises(InputError, match=r"cannot be written .*No space left on device"):
        write_files(tmp_path, {name: "changed" for name in FILES})
    assert tree(tmp_path) == before


@pytest.mark.parametrize("good", [0, 1, 2])
def test_failure_while_renaming_changes_nothing(good, tmp_path, monkeypatch):
    (tmp_path / "a.txt").write_text("old")
    before = tree(tmp_path)
    renamed = []
    rename = Path.replace

    def replace(self: Path, target: Path) -> None:
        if len(renamed) == good:
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        renamed.append(target)
        rename(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(InputError, match=r"cannot be written .*Operation not permitted"):
        write_files(tmp_path, FILES)
    assert tree(tmp_path) == before


def test_interruption_leaves_no_draft(tmp_path, monkeypatch):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_files(tmp_path, FILES)
    assert tree(tmp_path) == {}


@pytest.mark.posix
@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_permissions_are_those_of_an_ordinary_file(umask, tmp_path):
    before = os.umask(umask)
    try:
        (path,) = write_files(tmp_path, {"a": "x"})
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask


@pytest.mark.posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666, 0o755])
def test_a_file_that_exists_keeps_its_permissions(mode, tmp_path):
    path = write_file(tmp_path / "a", "x")
    path.chmod(mode)
    write_file(path, "y")
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("y", mode)


@pytest.mark.posix
def test_replacement_of_a_private_file_is_private_from_the_start(tmp_path, monkeypatch):
    path = write_file(tmp_path / "a", "x")
    path.chmod(0o600)
    modes = []

    def watched(handle: int, mode: str, fdopen=os.fdopen):
        modes.append(stat.S_IMODE(os.fstat(handle).st_mode))
        return fdopen(handle, mode)

    monkeypatch.setattr(os, "fdopen", watched)
    write_file(path, "y")
    assert modes == [0o600]


def test_the_umask_of_the_process_stays_alone(tmp_path, monkeypatch):
    def forbidden(_: int) -> int:
        raise AssertionError("another thread would create its files without a umask")

    monkeypatch.setattr(os, "umask", forbidden)
    write_files(tmp_path, FILES)
    write_files(tmp_path, FILES)


def test_folder_under_a_file(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="file/folder cannot be written: it is a file, or lies below one"):
        write_files(tmp_path / "file" / "folder", FILES)
    assert tree(tmp_path) == {"file": b"x"}


@pytest.mark.posix
def test_folder_that_nothing_can_be_made_in():
    with pytest.raises(InputError, match=r"/proc/strapgen cannot be written"):
        write_files("/proc/strapgen", FILES)


def test_folder_where_a_file_belongs(tmp_path):
    (tmp_path / "c.bin").mkdir()
    with pytest.raises(InputError, match=r"c.bin is a folder; a file is to be written there"):
        write_files(tmp_path, FILES)
    assert tree(tmp_path) == {}


def test_name_that_is_too_long(tmp_path):
    with pytest.raises(InputError, match=r"cannot be written"):
        write_file(tmp_path / ("x" * 300), "x")


@pytest.mark.posix
def test_link_is_written_through(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    target = tmp_path / "elsewhere" / "target.txt"
    target.write_text("old")
    target.chmod(0o600)
    link = tmp_path / "link.txt"
    link.symlink_to(target)
    assert write_file(link, "new") == link
    assert link.is_symlink()
    assert (target.read_text(), stat.S_IMODE(target.stat().st_mode)) == ("new", 0o600)


@pytest.mark.posix
def test_pipe_is_not_replaced_by_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match=r"pipe is no ordinary file"):
        write_file(tmp_path / "pipe", "x")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_files_appear_in_order_the_last_one_last(tmp_path, monkeypatch):
    renamed = []
    rename = Path.replace

    def replace(self: Path, target: Path) -> None:
        assert all(draft.read_bytes() for draft in self.parent.iterdir()), (
            "all are whole before the first one moves"
        )
        renamed.append(target.name)
        rename(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    write_files(tmp_path, {"z": "1", "deep/er/a": "2", "b": "3"})
    assert renamed == ["z", "a", "b"]


def test_all_files_are_drafted_in_one_folder(tmp_path, monkeypatch):
    folders = set()
    fdopen = os.fdopen

    def opened(handle: int, mode: str):
        folders.update(path for path in tmp_path.rglob("*") if is_staged(path) and path.is_dir())
        return fdopen(handle, mode)

    monkeypatch.setattr(os, "fdopen", opened)
    write_files(tmp_path, FILES)
    assert [folder.parent for folder in folders] == [tmp_path]
    assert tree(tmp_path).keys() == FILES.keys()


def test_a_failure_leaves_no_folder_that_was_not_there(tmp_path, monkeypatch):
    (tmp_path / "deep").mkdir()
    monkeypatch.setattr(os, "fdopen", FullDisk(2))
    with pytest.raises(InputError):
        write_files(tmp_path, FILES)
    assert [path.name for path in tmp_path.rglob("*")] == ["deep"]


def forgotten(folder: Path, *names: str) -> Path:
    place = folder / ".strapgen-draft-01234567"
    place.mkdir(parents=True)
    for name in names:
        (place / name).write_text("half")
    return place


@pytest.mark.posix
@pytest.mark.parametrize("where", [".", "deep/er"])
def test_leftovers_of_killed_processes_are_removed(tmp_path, where):
    place = forgotten(tmp_path / where, "0", "1", "17")
    write_files(tmp_path, FILES)
    assert not place.exists()
    assert tree(tmp_path).keys() == FILES.keys()


@pytest.mark.parametrize("name", ["notes.txt", "0.c", ".0", "-1"])
def test_a_hidden_folder_with_anything_else_is_not_touched(tmp_path, name):
    place = forgotten(tmp_path, "0", name)
    write_files(tmp_path, FILES)
    assert tree(place).keys() == {"0", name}


def test_hidden_files_of_the_user_are_not_touched(tmp_path):
    names = (
        ".a.txt-01234567",
        ".strapgen",
        ".strapgen-draft-x/0",
        ".strapgen-draft-0123456/0",
        "deep/er/.b.txt",
    )
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("mine")
    (tmp_path / ".strapgen-draft-89abcdef").write_text("a file of that name")
    write_files(tmp_path, FILES)
    assert tree(tmp_path).keys() == {*FILES, *names, ".strapgen-draft-89abcdef"}


@pytest.mark.posix(root=False)
def test_a_folder_that_cannot_be_written_is_no_hindrance_for_one_below(tmp_path):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    tmp_path.chmod(0o555)
    write_files(tmp_path, {"deep/er/b.txt": "beta\n"})
    tmp_path.chmod(0o755)
    assert tree(tmp_path) == {"deep/er/b.txt": b"beta\n"}


def test_a_link_to_another_file_system_is_written_through(tmp_path):
    other = Path("/dev/shm")
    if not os.access(other, os.W_OK) or other.stat().st_dev == tmp_path.stat().st_dev:
        pytest.skip("there is no other file system to write to")
    with tempfile.TemporaryDirectory(dir=other) as name:
        (tmp_path / "link").symlink_to(Path(name) / "target")
        write_files(tmp_path, {"link": "new", "beside": "new"})
        assert tree(Path(name)) == {"target": b"new"}
    assert (tmp_path / "beside").read_text() == "new"


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


@pytest.mark.posix
def test_a_draft_is_private_and_gone_after_the_block(tmp_path):
    with drafts.draft_folder(tmp_path, ".draft-") as place:
        assert place.parent == tmp_path
        assert place.stat().st_mode & 0o777 == 0o700
    assert list(tmp_path.iterdir()) == []


def test_renamed_folders_stay(tmp_path):
    with drafts.draft_folder(tmp_path, ".draft-") as place:
        (place / "file").write_text("x")
        place.rename(tmp_path / "whole")
    assert (tmp_path / "whole" / "file").read_text() == "x"


@pytest.mark.posix
def test_the_draft_of_a_process_at_work_is_not_forgotten_until_it_is_killed(tmp_path):
    process, place = holding(tmp_path)
    os.utime(place, (0, 0))  # the clock says nothing
    assert list(drafts.forgotten(tmp_path, ".draft-")) == []
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert list(drafts.forgotten(tmp_path, ".draft-")) == [place]


@pytest.mark.posix
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


@pytest.mark.posix(root=True)
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
    locked, answers = drafts._lock, [None, None]
    monkeypatch.setattr(drafts, "_lock", lambda place: answers.pop() if answers else locked(place))
    with drafts.draft_folder(tmp_path, ".draft-") as place:
        assert list(tmp_path.iterdir()) == [place]


@pytest.mark.posix
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
    monkeypatch.setattr(drafts, "_lock", lambda _: None)
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


@pytest.mark.posix
def test_a_forked_process_leaves_the_folder_to_its_owner(tmp_path):
    done = subprocess.run([sys.executable, "-c", FORKING, str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
