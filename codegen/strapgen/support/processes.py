"""Lets the processes of a pool end with the process that started them, however that one ends."""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing import connection, parent_process


def begin_worker() -> None:
    """Begin a process of a pool: an interrupt is the parent's to handle, and the end of the parent ends it.

    Without that, a worker whose parent is killed waits for work until the machine is switched off.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process when the one that started it has ended; in a process that nobody started, do nothing."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_wait_for, args=(parent.sentinel,), daemon=True).start()


def _wait_for(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
