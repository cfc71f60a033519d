"""Folders in which a process works before what it makes is renamed into place; the next process removes forgotten ones.

A process holds a lock on its folder. The system releases it however the process ends, so that a folder without a lock
is one that nobody will finish.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # no POSIX system
    fcntl = None  # type: ignore[assignment]

#: Age in s from which a folder is forgotten on a file system that has no locks.
_FORGOTTEN = 3600
#: Number of folders that are tried before the system counts as busy.
_TRIALS = 20
#: Beginning of the name of a temporary folder.
_TEMPORARY = "strapgen-work-"
_FOLDER = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def draft_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """Make a private folder, its name the prefix and eight hexadecimal digits, that is removed after the block."""
    for _ in range(_TRIALS):
        place = parent / f"{prefix}{secrets.token_hex(4)}"
        place.mkdir(mode=0o700)
        descriptor = _lock(place)
        if descriptor is not None:  # else another process took it for a forgotten one, before it was locked
            break
        shutil.rmtree(place, ignore_errors=True)
    else:
        raise OSError(errno.EBUSY, os.strerror(errno.EBUSY), str(parent))
    owner = os.getpid()
    try:
        yield place
    finally:
        if os.getpid() == owner:  # a process that was forked leaves it
            shutil.rmtree(place, ignore_errors=True)
        if descriptor >= 0:
            os.close(descriptor)


def forgotten(parent: Path, prefix: str) -> Iterator[Path]:
    """Yield this user's draft folders of processes that are gone; while the caller has one, nobody else does."""
    name = re.compile(re.escape(prefix) + "[0-9a-f]{8}")
    folders: list[Path] = []
    with suppress(OSError):
        folders += [place for place in parent.iterdir() if name.fullmatch(place.name)]
    for place in folders:
        with suppress(OSError):
            status = place.lstat()
            is_mine = not hasattr(os, "geteuid") or status.st_uid == os.geteuid()
            if not stat.S_ISDIR(status.st_mode) or not is_mine:
                continue
            descriptor = _lock(place)
            if descriptor is None or (descriptor < 0 and 0 <= time.time() - status.st_mtime < _FORGOTTEN):
                continue
            try:
                yield place
            finally:
                if descriptor >= 0:
                    os.close(descriptor)


def remove_forgotten(parent: Path, prefix: str) -> None:
    """Remove the draft folders of processes that are gone."""
    for gone in forgotten(parent, prefix):
        shutil.rmtree(gone, ignore_errors=True)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Make a private folder among the temporary ones that is gone after the block; see `draft_folder`."""
    parent = Path(tempfile.gettempdir())
    remove_forgotten(parent, _TEMPORARY)
    with draft_folder(parent, _TEMPORARY) as place:
        yield place


def _lock(place: Path) -> int | None:
    """Return a descriptor that locks a folder, -1 where there are no locks, None if another process has it."""
    if fcntl is None:
        return -1
    try:
        descriptor = os.open(place, _FOLDER)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        is_there = os.path.samestat(os.fstat(descriptor), place.lstat())
    except OSError as error:
        os.close(descriptor)
        return None if error.errno in (errno.EWOULDBLOCK, errno.EACCES, errno.ENOENT) else -1
    if not is_there:
        os.close(descriptor)
        return None
    return descriptor
