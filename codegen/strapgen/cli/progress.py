"""Progress of long commands on stderr: a bar on a terminal, else a line now and then."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
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
    done = 0
    stream = sys.stderr
    with _repeating(lambda: stream.write(f"{title}: {done} of {total}\n"), _BETWEEN_LINES, _BETWEEN_LINES):
        for item in items:
            yield item
            done += 1


@contextmanager
def _repeating(say: Callable[[], object], first: float, interval: float) -> Iterator[None]:
    """Say something after some seconds and again and again, from another thread, however long a step takes."""
    done, stream = threading.Event(), sys.stderr

    def run() -> None:
        wait = first
        while not done.wait(wait):
            with suppress(OSError, ValueError):  # whoever reads it has gone
                say()
                stream.flush()
            wait = interval

    saying = threading.Thread(target=run, daemon=True)
    saying.start()
    try:
        yield
    finally:
        done.set()
        saying.join()


@contextmanager
def waiting(title: str) -> Iterator[None]:
    """Show the seconds that a task has taken, once it takes more than one; where no terminal is, every ten."""
    stream, begin = sys.stderr, time.monotonic()
    if terminal.is_quiet():
        yield
        return
    on_terminal, is_shown = stream.isatty(), False

    def say() -> None:
        nonlocal is_shown
        is_shown = on_terminal
        text = f"{title} {time.monotonic() - begin:.0f} s"
        stream.write(f"{_WIPE}{text}" if on_terminal else f"{text}\n")

    times = (_PATIENCE, _INTERVAL) if on_terminal else (_BETWEEN_LINES, _BETWEEN_LINES)
    try:
        with _repeating(say, *times):
            yield
    finally:
        if is_shown:
            stream.write(_WIPE)
            stream.flush()


def say_unused(file: Path, unused: int, of_step: int, step: str = "step") -> None:
    """Say on stderr that increments at the end of a recording fill no step."""
    if unused:
        noun, fill, are = ("increment", "fills", "is") if unused == 1 else ("increments", "fill", "are")
        terminal.remark(
            f"strapgen: {file}: {unused} {noun} at the end {fill} no {step} of {of_step} and {are} left out"
        )
