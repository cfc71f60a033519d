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
    """Make a private folder that is removed after the block, if it is still there.

    Parameters
    ----------
    parent : Path
        The folder that it is made in.
    prefix : str
        Beginning of its name, eight hexadecimal digits follow.

    Yields
    ------
    Path

    Raises
    ------
    OSError
        If it cannot be made.
    """
    for _ in range(_TRIALS):
        place = parent / f"{prefix}{secrets.token_hex(4)}"
        place.mkdir(mode=0o700)
        descriptor = _locked(place)
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
    """Yield the folders of processes that are gone, for the caller to remove.

    Parameters
    ----------
    parent, prefix
        As for `draft_folder`.

    Yields
    ------
    Path
        A folder of this user; while the caller has it, nobody else does.
    """
    name = re.compile(re.escape(prefix) + "[0-9a-f]{8}")
    try:
        with os.scandir(parent) as places:
            folders = [Path(place.path) for place in places if name.fullmatch(place.name)]
    except OSError:
        return
    for place in folders:
        with suppress(OSError):
            status = place.lstat()
            if not stat.S_ISDIR(status.st_mode) or (hasattr(os, "geteuid") and status.st_uid != os.geteuid()):
                continue
            descriptor = _locked(place)
            if descriptor is None:
                continue
            if descriptor < 0:
                if 0 <= time.time() - status.st_mtime < _FORGOTTEN:
                    continue
                yield place
                continue
            try:
                yield place
            finally:
                os.close(descriptor)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Make a private folder among the temporary ones that is gone after the block; see `draft_folder`."""
    parent = Path(tempfile.gettempdir())
    for gone in forgotten(parent, _TEMPORARY):
        shutil.rmtree(gone, ignore_errors=True)
    with draft_folder(parent, _TEMPORARY) as place:
        yield place


def _locked(place: Path) -> int | None:
    """Return a descriptor that locks a folder, -1 where there are no locks, None if another process has it."""
    if fcntl is None:
        return -1
    try:
        descriptor = os.open(place, _FOLDER)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        here, there = os.fstat(descriptor), place.lstat()
    except OSError as error:
        os.close(descriptor)
        return None if error.errno in (errno.EWOULDBLOCK, errno.EACCES, errno.ENOENT) else -1
    if (here.st_dev, here.st_ino) != (there.st_dev, there.st_ino):
        os.close(descriptor)
        return None
    return descriptor
