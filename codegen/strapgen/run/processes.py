"""Lets the processes of a pool end with the process that started them, and prepares one for long derivations."""

from __future__ import annotations

import gc
import os
import signal
import threading

#: Objects made since the last search for garbage at which Python searches again, by generation. A derivation makes
#: millions that stay: with the 700 of the default a third of its time is searching.
_GARBAGE = (50_000, 20, 20)
#: Results of each function that SymPy remembers; its default of a thousand has it work out many of them again.
_SYMPY_RESULTS = 20_000


def prepare_for_derivations() -> None:
    """Let this process, and those that it starts, derive kernels in less time."""
    gc.set_threshold(*_GARBAGE)
    os.environ.setdefault("SYMPY_CACHE_SIZE", str(_SYMPY_RESULTS))


def begin_worker() -> None:
    """Begin a process of a pool: an interrupt is the parent's to handle, and the end of the parent ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare_for_derivations()
    end_with_parent()


def end_with_parent() -> None:
    """End this process when its parent process has ended; do nothing in a process without a parent."""
    from multiprocessing import connection, parent_process  # here, since every command imports this module

    def wait(sentinel: int) -> None:
        connection.wait([sentinel])
        os._exit(1)

    if (
        parent := parent_process()
    ) is not None:  # else a worker waits for work until the machine is switched off
        threading.Thread(target=wait, args=(parent.sentinel,), daemon=True).start()
