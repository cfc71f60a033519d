"""Progress of long commands on stderr: a bar on a terminal, else a line now and then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from strapgen.cli import terminal

Item = TypeVar("Item")
#: Seconds before the first message on a terminal, from one to the next, and between lines elsewhere.
_PATIENCE, _INTERVAL, _BETWEEN_LINES = 1.0, 1.0, 10.0
#: Clears the line of a terminal and returns to its beginning.
_WIPE = "\r\x1b[2K"


def track(items: Iterable[Item], title: str, total: int) -> Iterator[Item]:
    """Yield the items and show the number done."""
    if terminal.is_quiet():
        yield from items
        return
    if not sys.stderr.isatty():
        yield from _in_lines(items, title, total)
        return
    from rich import console, progress

    yield from progress.track(items, title, total, console=console.Console(stderr=True), transient=True)


def _in_lines(items: Iterable[Item], title: str, total: int) -> Iterator[Item]:
    last = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        if time.monotonic() - last >= _BETWEEN_LINES and done < total:
            terminal.remark(f"{title}: {done} of {total}")
            last = time.monotonic()


@contextmanager
def waiting(title: str) -> Iterator[None]:
    """Show the seconds that a task has taken, once it takes more than one; where no terminal is, every ten."""
    stream = sys.stderr
    if terminal.is_quiet():
        yield
        return
    done, begin = threading.Event(), time.monotonic()
    on_terminal = stream.isatty()
    first, interval = (_PATIENCE, _INTERVAL) if on_terminal else (_BETWEEN_LINES, _BETWEEN_LINES)

    def show() -> None:
        if done.wait(first):
            return
        while True:
            text = f"{title} {time.monotonic() - begin:.0f} s"
            stream.write(f"{_WIPE}{text}" if on_terminal else f"{text}\n")
            stream.flush()
            if done.wait(interval):
                break
        if on_terminal:
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
        noun, fill, are = ("increment", "fills", "is") if unused == 1 else ("increments", "fill", "are")
        terminal.remark(
            f"strapgen: {file}: {unused} {noun} at the end {fill} no {step} of {of_step} and {are} left out"
        )
