"""Locks on open files, which the system releases however a process ends."""

from __future__ import annotations

import os

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]
try:
    import msvcrt
except ImportError:  # any other system
    msvcrt = None  # type: ignore[assignment]

#: The byte that is locked on Windows, where nobody else may read what is locked: beyond the end of any results.
_FAR = 1 << 30


def lock(descriptor: int) -> bool:
    """Lock a file, and tell whether no other process has it; where there are no locks nobody can tell.

    The lock is not passed on to the processes of a pool.
    """
    try:
        if fcntl is not None:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            place = os.lseek(descriptor, 0, os.SEEK_CUR)
            try:
                os.lseek(descriptor, _FAR, os.SEEK_SET)
                msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
            finally:
                os.lseek(descriptor, place, os.SEEK_SET)
    except OSError:
        return False
    return True
