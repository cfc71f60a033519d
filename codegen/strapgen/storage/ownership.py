"""Opens folders and files that only the user can change, and refuses others.

What the cache holds is executed. A folder is opened from the root of the file system downwards, each part in the part
before it, and every part is checked on its descriptor: once a part has passed, nobody but the user and the
administrator can put another one in its place. On systems without owners in the sense of POSIX nothing is checked.
"""

from __future__ import annotations

import errno
import itertools
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

#: Whether the system has owners and modes of files, and opens files in folders that are open.
IS_CHECKED = hasattr(os, "geteuid") and os.open in os.supports_dir_fd
#: Flags of a folder whose files are listed, of one on the way, which need not be readable, and of a file: no links, and
#: no waiting for the writer of a pipe.
_LIST = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)
_PASS = getattr(os, "O_PATH", 0) | _LIST
_READ = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_calls = itertools.count(1)


class ForeignFileError(OSError):
    """Somebody else owns a file or a folder, or can write it."""

    def __init__(self, place: Path, reason: str) -> None:
        self.reason = f"{place} {reason}"
        super().__init__(errno.EPERM, self.reason)


class PrivateFolder:
    """An open folder that belongs to the user and that nobody else can write."""

    def __init__(self, place: Path, descriptor: int | None) -> None:
        self._place, self._descriptor = place, descriptor
        self._here = place if descriptor is None else descriptor

    def names(self) -> list[str]:
        """Return the names in the folder."""
        with os.scandir(self._here) as entries:
            return sorted(entry.name for entry in entries)

    def touch(self) -> None:
        """Set the time of the folder's last change to now."""
        os.utime(self._here)

    @contextmanager
    def opened(self, name: str) -> Iterator[int]:
        """Open an ordinary file of the folder that is the user's alone, and yield its descriptor."""
        path = name if IS_CHECKED else self._place / name
        descriptor = os.open(path, os.O_RDONLY | _READ, dir_fd=self._descriptor)
        try:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise ForeignFileError(self._place / name, "is no ordinary file")
            if IS_CHECKED and (reason := _fault(status, private=True)):
                raise ForeignFileError(self._place / name, reason)
            yield descriptor
        finally:
            os.close(descriptor)

    def read(self, name: str) -> bytes:
        """Return the content of a file of the folder; see `opened`."""
        with self.opened(name) as descriptor, os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read()


@contextmanager
def private_folder(place: Path, parts: int = 1) -> Iterator[PrivateFolder]:
    """Open a folder, given by an absolute path without links, that nobody but the user can change.

    This folder and the `parts` - 1 above it must belong to the user and be writable by nobody else. Those above may be
    the administrator's, and others may write them if they are sticky.
    """
    if not IS_CHECKED:
        yield PrivateFolder(place, None)
        return
    way = [*reversed(place.parents), place]
    descriptor = os.open(place.anchor, _PASS)
    try:
        for number, folder in enumerate(way):
            if number:
                inner = os.open(folder.name, _LIST if folder is place else _PASS, dir_fd=descriptor)
                os.close(descriptor)
                descriptor = inner
            if reason := _fault(os.fstat(descriptor), private=number >= len(way) - parts):
                raise ForeignFileError(folder, reason)
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


def _fault(status: os.stat_result, private: bool) -> str:
    """Return why others could change what is open, or what it holds if it need not be private; "" if they cannot."""
    is_trusted = status.st_uid == 0 or _is_outside(status.st_uid)
    if status.st_uid != os.geteuid() and (private or not is_trusted):
        return "belongs to another user"
    by_group = status.st_mode & stat.S_IWGRP and not _is_alone(status.st_gid, os.geteuid())
    is_sticky = not private and status.st_mode & stat.S_ISVTX
    is_open = (status.st_mode & stat.S_IWOTH or by_group) and not is_sticky
    return "can be written by other users" if is_open else ""


@cache
def _is_alone(group: int, user: int) -> bool:
    """Return whether a group is that of one user alone, as some systems make one for each user."""
    import grp
    import pwd

    with suppress(KeyError):
        person, members = pwd.getpwuid(user), grp.getgrgid(group)
        same = (members.gr_gid, members.gr_name) == (person.pw_gid, person.pw_name)
        return same and set(members.gr_mem) <= {person.pw_name}
    return False


@cache
def _is_outside(owner: int) -> bool:
    """Return whether an owner is nobody of this user namespace, as the administrator is in a container without one."""
    with suppress(OSError, ValueError):
        lines = Path("/proc/self/uid_map").read_text(encoding="utf-8").splitlines()
        mapped = [
            range(first, first + count) for first, _, count in (map(int, line.split()) for line in lines)
        ]
        overflow = int(Path("/proc/sys/kernel/overflowuid").read_text(encoding="utf-8"))
        return owner == overflow and not any(user in users for users in mapped for user in (0, owner))
    return False
