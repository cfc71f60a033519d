"""The command line: `main` runs the commands, each of which is a module that imports what it needs when it runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import typer

from strapgen.cli import version_option
from strapgen.cli.commands import (
    check,
    compare,
    coning,
    converge,
    derive,
    generate,
    listing,
    series,
    simulate,
    stability,
    strapdown,
    stress,
    study,
    tableau,
    tables,
    two_speed,
    vibration,
)
from strapgen.support.exceptions import StrapgenError

app = typer.Typer(
    name="strapgen",
    help="Derive strapdown attitude algorithms, generate numpy and C code for them, and test it against truth.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback()(version_option.options)
app.command("list")(listing.list_names)
app.command("tableau")(tableau.tableau)
app.command("coning")(coning.coning)
app.command("derive")(derive.derive)
app.command("generate")(generate.generate)
app.command("simulate")(simulate.simulate)
app.command("compare")(compare.compare)
app.command("converge")(converge.converge)
app.command("series")(series.series)
app.command("stability")(stability.stability)
app.command("check")(check.check)
app.command("vibration")(vibration.vibration)
app.command("tables")(tables.tables)
app.command("two-speed")(two_speed.two_speed)
app.command("strapdown")(strapdown.strapdown)
app.command("stress")(stress.stress)
app.add_typer(study.app, name="study")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line on stderr for input that cannot be used."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started us
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115, PTH123
    words = _spread_settings(list(sys.argv[1:] if arguments is None else arguments)) or ["--help"]
    try:
        status = app(words, prog_name="strapgen", standalone_mode=False)
        sys.stdout.flush()
    except StrapgenError as error:
        _fail(str(error))
    except BrokenPipeError:  # the reader has gone, as `head` does
        _drop_output()
        sys.exit(1)
    except OSError as error:  # the files that are asked for have errors of their own
        _drop_output()
        _fail(f"the output cannot be written ({error.strerror or error})")
    except MemoryError:
        _fail("the memory does not hold a run of so many steps")
    except (KeyboardInterrupt, typer.Abort):
        sys.stderr.write("strapgen: interrupted\n")
        sys.exit(130)
    except Exception as error:
        # Typer's errors of usage share no public base class over the releases that are allowed.
        explain = getattr(error, "format_message", None)
        if explain is None:
            raise
        said = explain() or "a command is needed"
        if said.startswith(("No such command", "Missing command")):
            context = getattr(error, "ctx", None)
            known = getattr(context and context.command, "commands", {})
            said += f" Allowed: {', '.join(known)}."
        _fail(said)
    sys.exit(status if isinstance(status, int) else 0)


def _drop_output() -> None:
    """Discard output that is still buffered, so that Python raises no error when it flushes it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(message: str) -> None:
    sys.stderr.write(f"strapgen: {' '.join(message.split())}\n")
    sys.exit(2)


def _spread_settings(words: list[str]) -> list[str]:
    """Let one --set take several settings: ``--set a=1 b=2`` becomes ``--set a=1 --set b=2``."""
    spread: list[str] = []
    inside = False
    for word in words:
        if inside and "=" in word and not word.startswith("-") and spread[-1] != "--set":
            spread.append("--set")
        elif word.startswith("-"):
            inside = word == "--set" or word.startswith("--set=")
        spread.append(word)
    return spread
