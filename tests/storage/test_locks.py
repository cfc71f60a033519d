"""Locks on open files: with POSIX, with those of Windows, and without any."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from strapgen.storage import locks

_OTHER = """
import os, sys
from strapgen.storage import locks
print(locks.lock(os.open(sys.argv[1], os.O_RDWR)))
"""


def other_locks(file) -> bool:
    """Tell whether another process can lock a file."""
    done = subprocess.run(
        [sys.executable, "-c", _OTHER, str(file)], capture_output=True, text=True, check=True
    )
    return done.stdout.strip() == "True"


@pytest.fixture
def descriptor(tmp_path):
    """Return a file with some content, open in its middle."""
    (tmp_path / "results").write_bytes(b"0123456789")
    handle = os.open(tmp_path / "results", os.O_RDWR)
    os.lseek(handle, 4, os.SEEK_SET)
    yield handle
    os.close(handle)


@pytest.mark.skipif(locks.fcntl is None, reason="a lock of POSIX")
def test_one_process_has_the_lock(descriptor, tmp_path):
    assert other_locks(tmp_path / "results")
    assert locks.lock(descriptor)
    assert not other_locks(tmp_path / "results")


@pytest.fixture
def windows(monkeypatch):
    """Let the module be as on Windows; return the bytes that are locked."""
    locked = []

    def locking(handle, mode, count):
        assert (mode, count) == (2, 1)
        place = os.lseek(handle, 0, os.SEEK_CUR)
        if place in locked:
            raise OSError(13, "Permission denied")
        locked.append(place)

    monkeypatch.setattr(locks, "fcntl", None)
    monkeypatch.setattr(locks, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    return locked


def test_on_windows_a_byte_far_behind_the_content_is_locked(descriptor, windows):
    from strapgen.lab import parallel_cases

    assert locks.lock(descriptor)
    assert windows == [1 << 30] and windows[0] > parallel_cases._MOST_BYTES
    assert not locks.lock(descriptor)
    assert os.read(descriptor, 3) == b"456"


def test_without_locks_nobody_is_kept_out(descriptor, monkeypatch):
    monkeypatch.setattr(locks, "fcntl", None)
    assert locks.msvcrt is None or sys.platform == "win32"
    monkeypatch.setattr(locks, "msvcrt", None)
    assert locks.lock(descriptor) and locks.lock(descriptor)


_IMPORTED = """
import importlib, sys
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
importlib.import_module(sys.argv[1])
"""


@pytest.mark.parametrize(
    "module",
    [
        "strapgen.storage.cache",
        "strapgen.lab.parallel_cases",
        "strapgen.evidence.gappa",
        "strapgen.cli.program",
        "strapgen.run.compiler",
        "strapgen.firmware.check_code.foreign",
    ],
)
def test_modules_are_imported_without_those_of_posix(module):
    done = subprocess.run(
        [sys.executable, "-c", _IMPORTED, module], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
