"""Options and arguments that several commands share, and how data is printed."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.progress import waiting
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.catalogue.methods.tableau import Tableau

Algorithm = Annotated[
    str,
    typer.Argument(
        help="dcm, euler, cayley-klein, another kernel of strapgen list, or your own Python file."
    ),
]
StepAlgorithm = Annotated[
    str, typer.Argument(help="dcm, euler or cayley-klein, or a Python file with an algorithm of your own.")
]
Method = Annotated[
    str | None,
    typer.Option(
        "--method", help="Integration method; strapgen list shows all.  [default: rk4]", show_default=False
    ),
]
TableauFile = Annotated[
    Path | None,
    typer.Option(
        "--tableau",
        metavar="FILE",
        help="A method of your own: a Butcher tableau in TOML.",
        show_default=False,
    ),
]
Previous = Annotated[
    str | None,
    typer.Option(
        "--previous",
        metavar="N",
        help="Increments before the step that it takes too, 0 to 3.  [default: 0]",
        show_default=False,
    ),
]
Increments = Annotated[
    str | None,
    typer.Option(
        "--increments", metavar="N", help="Angle increments a step, 1 to 8.  [default: 2]", show_default=False
    ),
]
Rates = Annotated[
    bool,
    typer.Option("--rates", help="The step takes the rate at the method's nodes, times the step length."),
]
Format = Annotated[str, typer.Option("--format", help="text or json.")]


def chosen(
    algorithm: str,
    method: str | None,
    tableau: Path | None,
    increments: str | None,
    previous: str | None,
    rates: bool = False,
    step: bool = True,
) -> Choice:
    """Return the kernel that options choose; with `step` it must be an attitude step."""
    from strapgen import catalogue
    from strapgen.catalogue.methods import tableaux

    chosen_method: str | Tableau | None = method
    if tableau is not None:
        if method is not None:
            raise InputError(f"--method {method} and --tableau {tableau} are both given; one is needed")
        chosen_method = tableaux.read(tableau)
    choose = catalogue.choose_step if step else catalogue.choose
    count, before = whole("increments", increments), whole("previous", previous) or 0
    with waiting(f"deriving {algorithm}"):  # a user's code may take its time
        return choose(algorithm, chosen_method, count, rates, before)


def check_format(value: str, *more: str) -> str:
    """Check the value of --format: text, json, or one of `more`."""
    return checks.choice("format", value, ["text", "json", *more])


def print_json(data: Any) -> None:
    """Print data as JSON: a list on one line, an object indented."""
    sys.stdout.write(json.dumps(data, indent=None if isinstance(data, list) else 1) + "\n")


def whole(what: str, value: str | None) -> int | None:
    """Read an option that takes a whole number."""
    return None if value is None else checks.whole(what, value)
