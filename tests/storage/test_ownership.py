"""Private folders: whatever somebody else could have changed is refused, for the administrator as for any user."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from strapgen.storage import ownership
from strapgen.storage.ownership import ForeignFileError, private_folder

#: A user who owns nothing here.
STRANGER = 65534
as_root = pytest.mark.posix(root=True)
pytestmark = pytest.mark.posix


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "above" / "folder"
    place.mkdir(parents=True)
    (place / "file").write_text("text")
    for path in (place.parent, place):
        path.chmod(0o755)
    (place / "file").chmod(0o644)
    return place


@pytest.fixture
def reachable() -> Iterator[Path]:
    """A folder that every user can enter; those of pytest are closed."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name).resolve()
        place.chmod(0o755)
        yield place


def read(place: Path, parts: int = 1) -> bytes:
    with private_folder(place, parts) as opened:
        return opened.read("file")


def test_private_files_are_read(folder):
    assert read(folder) == read(folder, 2) == b"text"
    with private_folder(folder) as opened:
        assert opened.names() == ["file"]


@pytest.mark.parametrize("mode", [0o777, 0o757, 0o1777, 0o722])
def test_a_folder_that_others_write_is_refused_even_if_it_is_sticky(folder, mode):
    folder.chmod(mode)
    with pytest.raises(ForeignFileError, match="folder can be written by other users"):
        read(folder)


@pytest.mark.parametrize(
    ("mode", "parts", "passes"), [(0o1777, 1, True), (0o777, 1, False), (0o1777, 2, False)]
)
def test_a_folder_above_may_be_sticky_where_it_need_not_be_private(folder, mode, parts, passes):
    folder.parent.chmod(mode)
    if passes:
        assert read(folder, parts) == b"text"
    else:
        with pytest.raises(ForeignFileError, match="above can be written by other users"):
            read(folder, parts)


@pytest.mark.parametrize("mode", [0o666, 0o646])
def test_a_file_that_others_write_is_refused(folder, mode):
    (folder / "file").chmod(mode)
    with pytest.raises(ForeignFileError, match="file can be written by other users"):
        read(folder)


@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_only_an_ordinary_file_is_read(folder, kind):
    file = folder / "file"
    file.rename(folder / "other")
    {"link": lambda: file.symlink_to("other"), "pipe": lambda: os.mkfifo(file), "folder": file.mkdir}[kind]()
    with pytest.raises(OSError):
        read(folder)


def test_no_link_leads_to_a_private_folder(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder.parent)
    with pytest.raises(OSError):
        read(tmp_path / "link" / "folder")


@as_root
@pytest.mark.parametrize("whose", ["file", ".", ".."])
def test_files_of_other_users_are_refused(folder, whose):
    os.chown(folder / whose, STRANGER, -1)
    with pytest.raises(ForeignFileError, match="belongs to another user"):
        read(folder)


def as_stranger(place: Path) -> str:
    """Return what another user reads in a folder, or why he does not; a fork, as he cannot start this Python."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(STRANGER)
            os.setuid(STRANGER)
            said = read(place)
        except OSError as error:
            said = str(error.strerror).encode()
        os.write(writing, said)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as answer:
        said = answer.read()
    os.waitpid(child, 0)
    return said


@as_root
def test_an_ordinary_user_trusts_neither_the_administrator_s_folder_nor_a_third_one_s(reachable):
    for name, owner in (("root", 0), ("third", 12345), ("stranger", STRANGER)):
        place = reachable / name
        place.mkdir(mode=0o755)
        (place / "file").write_text("text")
        (place / "file").chmod(0o644)
        for path in (place / "file", place):
            os.chown(path, owner, -1)

    assert as_stranger(reachable / "stranger") == "text"
    assert as_stranger(reachable / "root") == f"{reachable / 'root'} belongs to another user"
    assert as_stranger(reachable / "third") == f"{reachable / 'third'} belongs to another user"
    os.chown(reachable, 12345, -1)
    assert as_stranger(reachable / "stranger") == f"{reachable} belongs to another user"


def test_a_folder_of_the_administrator_is_private_to_no_other_user(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: STRANGER)
    with pytest.raises(ForeignFileError, match=r" / belongs to another user$"), private_folder(Path("/")):
        raise AssertionError


@pytest.mark.parametrize(
    ("users", "owner", "is_outside"),
    [
        ("0 0 4294967295", STRANGER, False),
        ("0 1000 1", STRANGER, False),
        ("1000 1000 1", STRANGER, True),
        ("1000 1000 1", 12, False),
        ("1000 1000 1\n60000 1 9999", STRANGER, False),
        ("", STRANGER, True),
        ("unreadable", STRANGER, False),
    ],
)
def test_nobody_is_the_administrator_only_where_the_namespace_has_neither(
    users, owner, is_outside, monkeypatch
):
    files = {"/proc/self/uid_map": users, "/proc/sys/kernel/overflowuid": f"{STRANGER}\n"}
    monkeypatch.setattr(Path, "read_text", lambda self, **_: files[str(self)])
    assert ownership._is_outside.__wrapped__(owner) is is_outside


@pytest.mark.parametrize(
    ("name", "primary", "members", "alone"),
    [
        ("me", 7, [], True),
        ("me", 7, ["me"], True),
        ("me", 7, ["you"], False),
        ("staff", 7, [], False),
        ("me", 8, [], False),
    ],
)
def test_a_group_is_the_user_s_alone_if_it_has_his_name_and_no_other_member(
    monkeypatch, name, primary, members, alone
):
    person = SimpleNamespace(pw_name="me", pw_gid=primary)
    monkeypatch.setattr("pwd.getpwuid", lambda _: person)
    monkeypatch.setattr("grp.getgrgid", lambda _: SimpleNamespace(gr_name=name, gr_gid=7, gr_mem=members))
    assert ownership._is_alone.__wrapped__(7, 1) is alone


def test_a_folder_that_the_user_s_group_writes_is_private_if_the_group_is_the_user_s_alone(
    folder, monkeypatch
):
    folder.chmod(0o775)
    monkeypatch.setattr(ownership, "_is_alone", lambda group, user: True)
    assert read(folder) == b"text"
    monkeypatch.setattr(ownership, "_is_alone", lambda group, user: False)
    with pytest.raises(ForeignFileError):
        read(folder)


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system has no paths to open files")
def test_path_to_an_open_file_survives_replacement(folder):
    with private_folder(folder) as opened, opened.opened("file") as descriptor:
        paths = [ownership.path_of(descriptor, folder / "file") for _ in range(20)]
        (folder / "file").unlink()
        (folder / "file").write_text("another")
        assert {Path(path).read_text() for path in paths} == {"text"}
    assert len(set(paths)) == 20, "the dynamic linker knows libraries by their paths"


def test_modes_are_looked_at_on_the_opened_file(folder, monkeypatch):
    """What a path says may be true of another file a moment later."""

    def forbidden(*_: object, **__: object) -> None:
        raise AssertionError("looked at by path")

    for name in ("stat", "lstat", "access"):
        monkeypatch.setattr(os, name, forbidden)
    assert read(folder) == b"text"
    assert stat.S_ISREG(os.fstat(os.open(folder / "file", os.O_RDONLY)).st_mode)
