"""The command line: `main` runs the commands, each of which imports what it needs when it runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any, ClassVar

import typer

from strapgen import registration
from strapgen.cli import version_option
from strapgen.cli.help import PlainCommand, PlainGroup, explanation
from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.registration import Command
from strapgen.run.processes import prepare_for_derivations

#: Headings of ``strapgen --help`` in their order.
HEADINGS = ("Derive", "Generate", "Run", "Analyse", "Reproduce")

#: With which shells ask for the words that may follow.
_COMPLETING = "_STRAPGEN_COMPLETE"
#: Most characters of a word that a message repeats, what is left of a longer one, and most characters of a message.
_LONGEST_WORD, _CUT, _LONGEST_LINE = 300, 60, 2000


class _Strapgen(PlainGroup):
    """The program itself."""

    headings: ClassVar[dict[str, list[str]]] = {heading: [] for heading in HEADINGS}
    summaries: ClassVar[dict[str, str]] = {}


_app = typer.Typer(
    name="strapgen",
    cls=_Strapgen,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_app.callback()(version_option.options)
#: Commands that were added, and groups of commands by name.
_added: set[str] = set()
_groups: dict[str, typer.Typer] = {}


def headings() -> dict[str, list[str]]:
    """Return the commands below each heading of ``strapgen --help``."""
    return _Strapgen.headings


def _add(name: str, command: Command, function: Any) -> None:
    """Add a command to the program, and before it the group of which it is one."""
    if name in _added:
        return
    _added.add(name)
    group, _, member = name.rpartition(" ")
    if isinstance(function, typer.Typer):
        _app.add_typer(function, name=name)
        _groups[name] = function
        return
    if group in _OWN:
        _add_own(group)
    to = _groups[group] if group else _app
    to.command(member, cls=PlainCommand, hidden=command.hidden)(function)


def _list(name: str, command: Command) -> None:
    """Let the help list a command."""
    names = _Strapgen.headings.setdefault(command.heading, []) if command.heading else [name]
    if name not in names:
        names.append(name)
        _Strapgen.summaries[name] = command.summary


#: The commands of strapgen by name, all of which the help lists before one is imported.
_OWN = {name: command for one in registration.built_in().values() for name, command in one.commands.items()}
for _name, _command in _OWN.items():
    _list(_name, _command)


def _add_own(*names: str) -> None:
    """Add commands of strapgen, which are imported for that."""
    for name in names:
        if name not in _added:
            _add(name, _OWN[name], registration.load(_OWN[name].function))


def _add_installed() -> None:
    """Add the commands of installed packages that can be used."""
    for name, command, function in registration.installed_commands():
        if not isinstance(function, InputError):
            _add(name, command, function)
            _list(name, command)


def _add_asked(words: Sequence[str]) -> None:
    """Add the command of a command line alone; all of them where that is not enough."""
    asked = next((word for word in words if not word.startswith("-")), "")
    if _COMPLETING in os.environ or (asked and asked not in _OWN):
        _add_own(*_OWN)
    elif asked:
        _add_own(asked, *(name for name in _OWN if name.startswith(f"{asked} ")))
    if asked not in _OWN or asked in _groups:
        _add_installed()


def __getattr__(name: str) -> Any:
    """Return the program with all commands of strapgen as `app`."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    _add_own(*_OWN)
    return _app


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line on stderr for input that cannot be used."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started us
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115, PTH123
    prepare_for_derivations()
    words = _spread_settings(list(sys.argv[1:] if arguments is None else arguments)) or ["--help"]
    try:
        _add_asked(words)
        status = _app(words, prog_name="strapgen", standalone_mode=False)
        sys.stdout.flush()
    except StrapgenError as error:
        # A name that is not known may be that of a package that cannot be used.
        unusable = registration.broken() if getattr(error, "unknown_name", False) else []
        _fail("; ".join([*unusable, str(error)]))
    except BrokenPipeError:  # the reader has gone, as `head` does
        _drop_output()
        sys.exit(1)
    except OSError as error:
        if error.filename is not None:  # a name that no file can have
            _fail(f"{error.filename} cannot be used ({error.strerror})")
        _drop_output()
        _fail(f"the output cannot be written ({error.strerror or error})")
    except MemoryError:
        _fail("the memory does not hold a run of so many steps")
    except (KeyboardInterrupt, typer.Abort):
        sys.stderr.write("strapgen: interrupted\n")
        sys.exit(130)
    except Exception as error:
        if hasattr(error, "format_message") and (unusable := registration.broken()):
            _fail(unusable[0])
        # Typer's errors of usage share no public base class over the releases that are allowed.
        if not hasattr(error, "format_message"):
            raise
        _fail(explanation(error))
    sys.exit(status if isinstance(status, int) else 0)


def _drop_output() -> None:
    """Discard output that is still buffered, so that Python raises no error when it flushes it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str) -> None:
    if _COMPLETING in os.environ:
        sys.exit(
            0
        )  # words that are not complete yet are no mistake, and a line would stand in the user's prompt
    message = "".join(letter if letter.isprintable() else " " for letter in message)
    line = " ".join(word if len(word) <= _LONGEST_WORD else f"{word[:_CUT]}..." for word in message.split())
    sys.stderr.write(f"strapgen: {line if len(line) <= _LONGEST_LINE else line[:_LONGEST_LINE] + '...'}\n")
    sys.exit(2)


def _spread_settings(words: list[str]) -> list[str]:
    """Let one --set take several settings: ``--set a=1 b=2`` becomes ``--set a=1 --set b=2``; --force-set likewise."""
    spread: list[str] = []
    inside = ""
    for word in words:
        if inside and "=" in word and not word.startswith("-") and spread[-1] != inside:
            spread.append(inside)
        elif word.startswith("-"):
            name = word.partition("=")[0]
            inside = name if name in ("--set", "--force-set") else ""
        spread.append(word)
    return spread
