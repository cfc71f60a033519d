"""Progress of long commands, on stderr, and only if that is a terminal."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

Item = TypeVar("Item")
#: Seconds before the first message, and from one message to the next.
_PATIENCE, _INTERVAL = 1.0, 1.0
#: Clears the line of a terminal and returns to its beginning.
_WIPE = "\r\x1b[2K"


def track(items: Iterable[Item], title: str, total: int) -> Iterator[Item]:
    """Yield the items and show the number done."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich import console, progress

    yield from progress.track(items, title, total, console=console.Console(stderr=True), transient=True)


@contextmanager
def waiting(title: str) -> Iterator[None]:
    """Show the seconds that a task has taken, once it takes more than one."""
    stream = sys.stderr
    if not stream.isatty():
        yield
        return
    done, begin = threading.Event(), time.monotonic()

    def show() -> None:
        if done.wait(_PATIENCE):
            return
        while True:
            stream.write(f"{_WIPE}{title} {time.monotonic() - begin:.0f} s")
            stream.flush()
            if done.wait(_INTERVAL):
                break
        stream.write(_WIPE)
        stream.flush()

    shown = threading.Thread(target=show, daemon=True)
    shown.start()
    try:
        yield
    finally:
        done.set()
        shown.join()


def say_unused(file: Path, unused: int, of_step: int, step: str = "step") -> None:
    """Say on stderr that increments at the end of a recording fill no step."""
    if unused:
        verb = "increment at the end fills" if unused == 1 else "increments at the end fill"
        import typer

        typer.echo(f"strapgen: {file}: {unused} {verb} no {step} of {of_step} and is left out", err=True)
