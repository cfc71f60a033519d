"""Opens folders and files that nobody but the user can change, and refuses others.

What strapgen executes from the cache must come from the user. A folder is therefore opened from the root of the file
system downwards, each part in the part before it, and every part is checked on its descriptor: once a part has passed,
nobody but the user and the administrator can put another one in its place. On systems without owners in the sense of
POSIX nothing is checked.
"""

from __future__ import annotations

import errno
import itertools
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

#: Whether the system has owners and modes of files, and opens files in folders that are open.
IS_CHECKED = hasattr(os, "geteuid") and os.open in os.supports_dir_fd
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
#: Flags of a folder on the way, which need not be readable, and of one whose files are listed.
_PASS = getattr(os, "O_PATH", 0) | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)
_LIST = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)
#: Flags of a file: neither a link nor a pipe that nobody writes.
_READ = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_calls = itertools.count(1)


class ForeignFileError(OSError):
    """Somebody else owns a file or a folder, or can write it."""

    def __init__(self, place: Path, reason: str) -> None:
        self.reason = f"{place} {reason}"
        super().__init__(errno.EPERM, self.reason)


class PrivateFolder:
    """An open folder that belongs to the user and that nobody else can write."""

    def __init__(self, place: Path, descriptor: int) -> None:
        self.place = place
        self._descriptor = descriptor

    def names(self) -> list[str]:
        """Return the names of what the folder holds."""
        with os.scandir(self._descriptor if IS_CHECKED else self.place) as entries:
            return sorted(entry.name for entry in entries)

    def touch(self) -> None:
        """Set the time of the folder's last change to now."""
        os.utime(self._descriptor if IS_CHECKED else self.place)

    @contextmanager
    def opened(self, name: str) -> Iterator[int]:
        """Open a file of the folder, and yield its descriptor.

        Raises
        ------
        ForeignFileError
            If it is no ordinary file, belongs to another user, or others can write it.
        OSError
            If it cannot be opened.
        """
        if IS_CHECKED:
            descriptor = os.open(name, os.O_RDONLY | _READ, dir_fd=self._descriptor)
        else:
            descriptor = os.open(self.place / name, os.O_RDONLY | _READ)
        try:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise ForeignFileError(self.place / name, "is no ordinary file")
            if IS_CHECKED and (reason := _foreign(status)):
                raise ForeignFileError(self.place / name, reason)
            yield descriptor
        finally:
            os.close(descriptor)

    def read(self, name: str) -> bytes:
        """Return the content of a file of the folder; see `opened`."""
        with self.opened(name) as descriptor, os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read()


@contextmanager
def private_folder(place: Path, parts: int = 1) -> Iterator[PrivateFolder]:
    """Open a folder that nobody but the user can change.

    Parameters
    ----------
    place : Path
        Absolute, and without links.
    parts : int, optional
        Number of folders, this one and those above it, that must belong to the user and be writable by nobody else. A
        folder above these may be the administrator's, and others may write it if it is sticky.

    Yields
    ------
    PrivateFolder

    Raises
    ------
    ForeignFileError
        If a folder does not comply.
    OSError
        If one cannot be opened.
    """
    if not IS_CHECKED:
        yield PrivateFolder(place, -1)
        return
    descriptor = os.open(place.anchor, _PASS)
    try:
        reason, count = _unsafe(os.fstat(descriptor)), len(place.parts)
        for number, part in enumerate(place.parts[1:], 2):
            if reason:
                raise ForeignFileError(Path(*place.parts[: number - 1]), reason)
            inner = os.open(part, _LIST if number == count else _PASS, dir_fd=descriptor)
            os.close(descriptor)
            descriptor = inner
            reason = (_foreign if number > count - parts else _unsafe)(os.fstat(descriptor))
        if reason:
            raise ForeignFileError(place, reason)
        yield PrivateFolder(place, descriptor)
    finally:
        os.close(descriptor)


def path_of(descriptor: int, place: Path) -> str:
    """Return a path to an open file that nothing leads elsewhere; that of `place` if the system has none.

    No two calls return the same text: the dynamic linker takes a path that it knows for the library that it has loaded
    from there, and the number of a descriptor that was closed comes again. Strokes and dots that change nothing count
    the calls.
    """
    with suppress(OSError):
        if os.path.samestat(Path(f"/proc/self/fd/{descriptor}").stat(), os.fstat(descriptor)):
            count = f"{next(_calls):b}".replace("1", "/.").replace("0", "/")
            return f"/proc/self{count}/fd/{descriptor}"
    return str(place)


def _foreign(status: os.stat_result) -> str:
    """Return why a file or a folder is not the user's alone; "" if it is."""
    if status.st_uid != os.geteuid():
        return "belongs to another user"
    return "can be written by other users" if _others_write(status) else ""


def _unsafe(status: os.stat_result) -> str:
    """Return why others could replace what a folder holds; "" if they cannot."""
    if status.st_uid not in (0, os.geteuid()) and not _is_outside(status.st_uid):
        return "belongs to another user"
    is_sticky = status.st_mode & stat.S_ISVTX
    return "can be written by other users" if _others_write(status) and not is_sticky else ""


def _others_write(status: os.stat_result) -> bool:
    mode = status.st_mode & _OTHERS_WRITE
    return bool(mode & stat.S_IWOTH or (mode & stat.S_IWGRP and not _is_alone(status.st_gid, os.geteuid())))


@lru_cache(maxsize=64)
def _is_alone(group: int, user: int) -> bool:
    """Return whether a group is that of one user alone, as some systems make one for each user."""
    import grp
    import pwd

    with suppress(KeyError):
        person, members = pwd.getpwuid(user), grp.getgrgid(group)
        same = (members.gr_gid, members.gr_name) == (person.pw_gid, person.pw_name)
        return same and set(members.gr_mem) <= {person.pw_name}
    return False


@lru_cache(maxsize=64)
def _is_outside(owner: int) -> bool:
    """Return whether an owner is nobody of this user namespace, as the administrator is in a container without one."""
    with suppress(OSError, ValueError):
        ranges = [
            tuple(map(int, line.split())) for line in Path("/proc/self/uid_map").read_text().splitlines()
        ]
        has_root = any(first == 0 for first, _, _ in ranges)
        is_mapped = any(first <= owner < first + count for first, _, count in ranges)
        overflow = int(Path("/proc/sys/kernel/overflowuid").read_text())
        return owner == overflow and not has_root and not is_mapped
    return False
