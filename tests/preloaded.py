"""Processes that begin with what they import: tests that start and kill many of them do not import it each time."""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path

#: What schedulers, workers and commands import.
MODULES = [
    "sympy",
    "scipy.linalg",
    "distributed.cli.dask_scheduler",
    "distributed.cli.dask_worker",
    "strapgen.cli",
]


@contextmanager
def imported() -> Iterator[None]:
    """Import it once, in a process from which those of `begin` part; it ends with the block."""
    multiprocessing.get_context("forkserver").set_forkserver_preload(MODULES)
    try:
        yield
    finally:
        forkserver._forkserver._stop()


def begin(words: Sequence[str], output: Path, **environment: str) -> BaseProcess:
    """Begin ``strapgen ...``, or ``scheduler ...`` or ``worker ...`` of Dask; what it says is in two files."""
    context = multiprocessing.get_context("forkserver")
    process = context.Process(target=_run, args=(list(words), str(output), environment), daemon=True)
    process.start()
    return process


def said(output: Path) -> tuple[str, str]:
    """Return what a process printed, and what it said on stderr."""
    return Path(f"{output}.out").read_text(), Path(f"{output}.err").read_text()


def _run(words: list[str], output: str, environment: Mapping[str, str]) -> None:
    os.environ.update(environment)
    for number, ending in ((1, "out"), (2, "err")):
        os.dup2(os.open(f"{output}.{ending}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), number)
    sys.argv = words
    module = "strapgen.cli" if words[0] == "strapgen" else f"distributed.cli.dask_{words[0]}"
    import_module(module).main(words[1:])
