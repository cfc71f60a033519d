"""The command line: `main` runs the commands, each of which is a module that imports what it needs when it runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any, ClassVar

import typer

from strapgen.cli import version_option
from strapgen.cli.commands import (
    check,
    compare,
    coning,
    converge,
    cost,
    derive,
    design,
    evidence,
    frontier,
    generate,
    listing,
    rate_table,
    redundancy,
    report,
    series,
    simulate,
    solve,
    stability,
    statements,
    strapdown,
    study,
    study_attitude_form,
    study_calibration,
    study_loops,
    study_monte_carlo,
    study_output_filter,
    study_pulse_torque,
    study_redundancy,
    study_sensor_errors,
    study_system,
    study_velocity_position,
    system,
    tableau,
    tables,
    two_speed,
    vectors,
    verify,
    vibration,
    window_generate,
)
from strapgen.cli.help import PlainCommand, PlainGroup, explanation
from strapgen.support.exceptions import StrapgenError
from strapgen.support.processes import prepare_for_derivations

#: Headings of ``strapgen --help``, and the commands below each.
COMMANDS: dict[str, dict[str, Any]] = {
    "Derive": {
        "list": listing.list_names,
        "derive": derive.derive,
        "tableau": tableau.tableau,
        "solve": solve.solve,
        "coning": coning.coning,
        "window": window_generate.app,
    },
    "Generate": {
        "generate": generate.generate,
        "two-speed": two_speed.two_speed,
        "system": system.system,
        "redundancy": redundancy.redundancy,
        "vectors": vectors.vectors,
        "verify": verify.verify,
        "evidence": evidence.evidence,
    },
    "Run": {"simulate": simulate.simulate, "strapdown": strapdown.strapdown, "compare": compare.compare},
    "Analyse": {
        "series": series.series,
        "vibration": vibration.vibration,
        "stability": stability.stability,
        "converge": converge.converge,
        "check": check.check,
        "cost": cost.cost,
        "frontier": frontier.frontier,
        "design": design.design,
        "report": report.report,
    },
    "Reproduce": {
        "tables": tables.tables,
        "statements": statements.statements,
        "rate-table": rate_table.rate_table,
        "study": study.app,
    },
}

#: With which shells ask for the words that may follow.
_COMPLETING = "_STRAPGEN_COMPLETE"
#: Most characters of a word that a message repeats, what is left of a longer one, and most characters of a message.
_LONGEST_WORD, _CUT, _LONGEST_LINE = 300, 60, 2000


class _Strapgen(PlainGroup):
    """The program itself."""

    headings: ClassVar[dict[str, tuple[str, ...]]] = {
        heading: tuple(commands) for heading, commands in COMMANDS.items()
    }


study.app.command("system", cls=PlainCommand)(study_system.study_system)
study.app.command("attitude-form", cls=PlainCommand)(study_attitude_form.study_attitude_form)
study.app.command("output-filter", cls=PlainCommand)(study_output_filter.study_output_filter)

study.app.command("redundancy", cls=PlainCommand)(study_redundancy.study_redundancy)
study.app.command("calibration", cls=PlainCommand)(study_calibration.study_calibration)
study.app.command("pulse-torque", cls=PlainCommand)(study_pulse_torque.study_pulse_torque)
study.app.command("sensor-errors", cls=PlainCommand)(study_sensor_errors.study_sensor_errors)
study.app.command("loops", cls=PlainCommand)(study_loops.study_loops)
study.app.command("velocity-position", cls=PlainCommand)(study_velocity_position.study_velocity_position)
study.app.command("monte-carlo", cls=PlainCommand)(study_monte_carlo.study_monte_carlo)

app = typer.Typer(
    name="strapgen",
    cls=_Strapgen,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.callback()(version_option.options)
for _commands in COMMANDS.values():
    for _name, _command in _commands.items():
        if isinstance(_command, typer.Typer):
            app.add_typer(_command, name=_name)
        else:
            app.command(_name, cls=PlainCommand)(_command)
app.command("stress", cls=PlainCommand, hidden=True)(rate_table.rate_table)  # its name in earlier releases


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line on stderr for input that cannot be used."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by whoever started us
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115, PTH123
    prepare_for_derivations()
    words = _spread_settings(list(sys.argv[1:] if arguments is None else arguments)) or ["--help"]
    try:
        status = app(words, prog_name="strapgen", standalone_mode=False)
        sys.stdout.flush()
    except StrapgenError as error:
        _fail(str(error))
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
