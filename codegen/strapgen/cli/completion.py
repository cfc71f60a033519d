"""Completion of words in a shell: the names that options and arguments take; SymPy is not imported for it."""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from strapgen import registration
from strapgen.ir.exceptions import StrapgenError

#: Names as they are, or a place "module:name" of them or of a function that returns them
Words = str | Sequence[str]
#: Completes a word; the parameter has the name and the type by which Typer knows it.
Complete = Callable[[str], "list[tuple[str, str] | str]"]
#: The variable by which a shell asks.
_ASKS = "_STRAPGEN_COMPLETE"
#: Names that an option or argument takes in every command that declares no others.
_NAMES = {
    "ALGORITHM": "strapgen.catalogue.names:reserved",
    "--versus": "strapgen.catalogue.names:reserved",
    "--method": "strapgen.catalogue:METHODS",
    "--versus-method": "strapgen.catalogue:METHODS",
    "--motion": "strapgen.cli.completion:motions",
    "--target": "strapgen.targets:TARGETS",
    "--backend": "strapgen.run.backend_names:BACKENDS",
    "--variant": "@cli.variants",
    "--cpu": "@cli.processors",
    "--rounding": "strapgen.ir.formats:ROUNDINGS",
    "--carry": "strapgen.ir.fixed_settings:CARRIES",
}


def is_asked() -> bool:
    """Return whether a shell asks for the words that may follow."""
    return _ASKS in os.environ


def answer(run: Callable[[list[str]], Any]) -> int:
    """Write the words that a shell asks for, and nothing else; return the exit status.

    Words that are not complete yet are no mistake, and a line of one would stand in the prompt. Fish alone reads the
    status, when it asks whether to offer files: 1 says so.
    """
    asks_for_files = os.environ.get("_TYPER_COMPLETE_FISH_ACTION") == "is-args"
    status: Any = int(asks_for_files)
    with contextlib.redirect_stderr(io.StringIO()), _one_line_each():
        try:
            run(_line())
            sys.stdout.flush()
        except SystemExit as end:
            status = end.code
        except BaseException:
            with contextlib.suppress(OSError, ValueError):  # the shell has gone
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return int(bool(status)) if asks_for_files else 0


@contextlib.contextmanager
def _one_line_each() -> Iterator[None]:
    """Let Rich, through which Typer writes meanings, break no line: fish would read the rest as another word."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "10000"
    try:
        yield
    finally:
        os.environ.pop("COLUMNS")
        if before is not None:
            os.environ["COLUMNS"] = before


def _line() -> list[str]:
    """Return the words before the one that a shell asks for, without the program's name."""
    text = os.environ.get("COMP_WORDS", os.environ.get("_TYPER_COMPLETE_ARGS", ""))
    try:
        words = shlex.split(text)
    except ValueError:  # a quotation mark is open
        words = text.split()
    return words[1 : None if text.endswith((" ", "\n")) else -1]


def of(words: Words) -> Complete:
    """Return a function that completes a word by names; of a comma-separated list it completes the last."""

    def complete(incomplete: str) -> list[tuple[str, str] | str]:
        before, comma, _ = incomplete.rpartition(",")
        given = {*before.split(",")}
        try:
            names = dict(_meanings(words))
        except StrapgenError:
            return []
        return [(f"{before}{comma}{name}", names[name]) for name in names if name not in given]

    return complete


def of_parameter(spelling: str, words: Words | None) -> Complete | None:
    """Return a function that completes the values of an option or argument; None for values without names."""
    known = words or _NAMES.get(spelling.removesuffix("..."))
    return None if known is None else of(known)


def motions() -> dict[str, str]:
    """Return the motions of runs with their parameters."""
    return registration.lists().get("motions", {})


def _meanings(words: Words) -> Iterator[tuple[str, str]]:
    """Yield names with what they mean, as far as that is known; a place "@point" names an extension point."""
    known: Any = words
    if isinstance(words, str):
        known = next(registration.extensions(words[1:]), ()) if words[0] == "@" else registration.load(words)
    if callable(known):
        known = known()
    names: Iterable[str] = known
    for name in names:
        meaning = known[name] if isinstance(known, Mapping) and type(known) is dict else ""
        yield name, meaning if isinstance(meaning, str) else ""
