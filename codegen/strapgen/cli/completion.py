"""Completion of words in a shell: the names that options and arguments take; SymPy is not imported for it."""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from inspect import signature
from typing import Any

from strapgen import registration
from strapgen.ir.exceptions import StrapgenError

#: Names as they are, or a place "module:name" of them, of a function that returns them, which may take the values of
#: the line by parameter, or of a dataclass whose fields are settings; the name of a setting ends with "="
Words = str | Sequence[str]
#: Completes a word; the parameters have the names and types by which Typer knows them.
Complete = Callable[[Any, str], "list[tuple[str, str] | str]"]
#: The variable by which a shell asks, and those with the line up to the cursor, in bash with more behind it.
_ASKS = "_STRAPGEN_COMPLETE"
_BASH_LINE, _LINE = "COMP_WORDS", "_TYPER_COMPLETE_ARGS"
#: Options whose value is a setting: each takes several with spaces between.
SETTING_OPTIONS = ("--set", "--force-set")
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
    """Return the words before the one that a shell asks for, without the program's name.

    Typer gets them as it would parse them: with ``=`` in its word, which bash makes a word of its own, with every
    setting behind an option, and without ``help`` before the name of a command.
    """
    name = _BASH_LINE if _BASH_LINE in os.environ else _LINE
    text = os.environ.get(name, "")
    try:
        words = shlex.split(text)
    except ValueError:  # a quotation mark is open
        return text.split()[1:-1]
    position = os.environ.get("COMP_CWORD", "") if name == _BASH_LINE else ""
    last = int(position) if position.isdecimal() else len(words) - (not text.endswith((" ", "\n")))
    *before, unfinished = _with_equals([*words[1:last], words[last] if last < len(words) else ""])
    before = spread_settings(before, unfinished.startswith("-"))
    if before[:1] == ["help"]:
        del before[0]
        if before and not _is_group(before):
            raise SystemExit(1)
    os.environ[name] = f"{shlex.join(['strapgen', *before])} {shlex.join([unfinished][: len(unfinished)])}"
    os.environ["COMP_CWORD"] = str(1 + len(before))
    return before


def _with_equals(words: Iterable[str]) -> list[str]:
    """Return words with each ``=`` that stands alone joined to its neighbours."""
    joined: list[str] = []
    open_ = False  # whether the last word ends with such a sign
    for word in words:
        if joined and (open_ or word == "="):
            joined[-1] += word
        else:
            joined.append(word)
        open_ = word == "="
    return joined


def spread_settings(words: Iterable[str], is_whole: bool = True) -> list[str]:
    """Let one --set take several settings: ``--set a=1 b=2`` becomes ``--set a=1 --set b=2``; --force-set likewise.

    Of a line that is not whole, the next word may be a setting too.
    """
    spread: list[str] = []
    inside = ""
    for word in words:
        if inside and "=" in word and not word.startswith("-") and spread[-1] != inside:
            spread.append(inside)
        elif word.startswith("-"):
            name = word.partition("=")[0]
            inside = name if name in SETTING_OPTIONS else ""
        spread.append(word)
    if inside and not is_whole and "=" in spread[-1]:
        spread.append(inside)
    return spread


def _is_group(words: Sequence[str]) -> bool:
    """Return whether a command with these words as its name is one of a group."""
    start = f"{' '.join(words)} "
    own = [name for one in registration.built_in().values() for name in one.commands]
    return any(name.startswith(start) for name in own) or any(
        name.startswith(start) for name, *_ in registration.installed_commands()
    )


def of(words: Words) -> Complete:
    """Return a function that completes a word by names; of a comma-separated list it completes the last.

    A setting that the line has is not offered again, nor is one whose value has begun.
    """

    def complete(ctx: Any, incomplete: str) -> list[tuple[str, str] | str]:
        before, comma, _ = incomplete.rpartition(",")
        stated = [v for value in ctx.params.values() if isinstance(value, list | tuple) for v in value]
        given = {*before.split(","), *(f"{str(one).partition('=')[0]}=" for one in stated)}
        try:
            names = dict(_meanings(words, ctx.params))
        except StrapgenError:
            return []
        started = "=" in incomplete
        return [
            (f"{before}{comma}{name}", names[name])
            for name in names
            if name not in given and not (started and name.endswith("="))
        ]

    return complete


def of_parameter(spelling: str, words: Words | None) -> Complete | None:
    """Return a function that completes the values of an option or argument; None for values without names."""
    known = words or _NAMES.get(spelling.removesuffix("..."))
    return None if known is None else of(known)


def motions() -> dict[str, str]:
    """Return the motions of runs with their parameters."""
    return registration.lists().get("motions", {})


def _meanings(words: Words, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield names with what they mean, as far as that is known; a place "@point" names an extension point."""
    known: Any = words
    if isinstance(words, str):
        known = next(registration.extensions(words[1:]), ()) if words[0] == "@" else registration.load(words)
    if isinstance(known, type):
        known = [f"{field.name}=" for field in fields(known)]
    elif callable(known):
        known = known(values) if signature(known).parameters else known()
    names: Iterable[str] = known
    for name in names:
        meaning = known[name] if isinstance(known, Mapping) and type(known) is dict else ""
        yield name, meaning if isinstance(meaning, str) else ""
