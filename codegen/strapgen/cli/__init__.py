"""The command line: `main` runs the commands, each of which imports what it needs when it runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any

from strapgen import registration
from strapgen.cli import completion, help_layout
from strapgen.ir.exceptions import StrapgenError

#: Most characters of a word that a message repeats, what is left of a longer one, and most characters of a message.
_LONGEST_WORD, _CUT, _LONGEST_LINE = 300, 60, 2000


def __getattr__(name: str) -> Any:
    """Return the program with all commands of strapgen as `app`."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from strapgen.cli import program

    return program.app()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line on stderr for input that cannot be used."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started us
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123
    words = list(sys.argv[1:] if arguments is None else arguments)
    if completion.is_asked():
        sys.exit(completion.answer(_run_program))
    try:
        status = _run(words)
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
    except KeyboardInterrupt:
        _interrupted()
    except Exception as error:
        import typer

        from strapgen.cli.program import explanation

        if isinstance(error, typer.Abort):
            _interrupted()
        # Typer's errors of usage share no public base class over the releases that are allowed.
        if not hasattr(error, "format_message"):
            raise
        _fail(next(iter(registration.broken()), "") or explanation(error))
    sys.exit(status if isinstance(status, int) else 0)


def _run(words: list[str]) -> Any:
    """Run a command line, and return its exit status; the help of the program needs no library."""
    if not words or words in (["--help"], ["-h"]):
        sys.stdout.write(f"{help_layout.program_help() if words else help_layout.first_steps()}\n")
        return 0
    from strapgen.run.processes import prepare_for_derivations

    prepare_for_derivations()
    return _run_program(completion.spread_settings(_asked_help(words)))


def _run_program(words: list[str]) -> Any:
    from strapgen.cli import program

    return program.run(words)


def _asked_help(words: list[str]) -> list[str]:
    """Return ``help COMMAND`` as ``COMMAND --help``."""
    return [*words[1:], "--help"] if words[0] == "help" else words


def _interrupted() -> None:
    sys.stderr.write("strapgen: interrupted\n")
    sys.exit(130)


def _drop_output() -> None:
    """Discard output that is still buffered, so that Python raises no error when it flushes it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str) -> None:
    message = "".join(letter if letter.isprintable() else " " for letter in message)
    line = " ".join(word if len(word) <= _LONGEST_WORD else f"{word[:_CUT]}..." for word in message.split())
    sys.stderr.write(f"strapgen: {line if len(line) <= _LONGEST_LINE else line[:_LONGEST_LINE] + '...'}\n")
    sys.exit(2)
