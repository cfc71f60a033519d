"""Options that choose an algorithm and its method, shared by several commands, and readers of option values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.progress import waiting
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice

Algorithm = Annotated[
    str,
    typer.Argument(
        help="dcm, euler, cayley-klein, any other kernel that strapgen list shows, or a Python file of your own."
    ),
]
StepAlgorithm = Annotated[
    str, typer.Argument(help="dcm, euler or cayley-klein, or a Python file with your own algorithm.")
]
Increments = Annotated[
    str | None,
    typer.Option(
        "--increments",
        metavar="N",
        help="Number of angle increments in a step, 1 to 8.  [default: 2]",
        show_default=False,
    ),
]


@dataclass(frozen=True)
class MethodOptions:
    """Options that choose the integration method of an algorithm and the samples that a step takes."""

    method: Annotated[
        str | None,
        typer.Option(
            "--method",
            help="Integration method; strapgen list shows all.  [default: rk4]",
            show_default=False,
        ),
    ] = None
    tableau: Annotated[
        Path | None,
        typer.Option(
            "--tableau",
            metavar="FILE",
            help="TOML file with the Butcher tableau of your own method, in place of --method.",
            show_default=False,
        ),
    ] = None
    increments: Increments = None
    previous: Annotated[
        str | None,
        typer.Option(
            "--previous",
            metavar="N",
            help="Number of increments from before the step that it uses as well, 0 to 3.  [default: 0]",
            show_default=False,
        ),
    ] = None
    rates: Annotated[
        bool,
        typer.Option(
            "--rates",
            help="Let the step take, in place of increments, body rates at the method's nodes, times the step length.",
        ),
    ] = False

    def choose(self, algorithm: str, *, step: bool = True) -> Choice:
        """Return the kernel that the options choose of an algorithm; with `step` it must be an attitude step."""
        from strapgen import catalogue
        from strapgen.catalogue.methods import tableaux

        if self.tableau is not None and self.method is not None:
            raise InputError(
                f"--method {self.method} and --tableau {self.tableau} are both given; one is needed"
            )
        method = self.method if self.tableau is None else tableaux.read(self.tableau)
        choose = catalogue.choose_step if step else catalogue.choose
        count, before = whole("increments", self.increments), whole("previous", self.previous) or 0
        with waiting(f"deriving {algorithm}"):  # a user's code may take its time
            return choose(algorithm, method, count, self.rates, before)


#: The options of an attitude step, which takes increments.
STEP_OPTIONS = ("method", "tableau", "increments", "previous")


def whole(what: str, value: str | None) -> int | None:
    """Read an option that takes a whole number."""
    return None if value is None else checks.whole(what, value)


def limit(what: str, value: str | None) -> float | None:
    """Read an option that takes a number from 0 on."""
    if value is None:
        return None
    number = float(checks.number(what, value))
    if number < 0:
        raise InputError(f"{what} is {value}; a number that is not below 0 is needed")
    return number


def listed(option: str, text: str, empty: str = "") -> list[str]:
    """Return the values of a comma-separated list, each once.

    Raises
    ------
    InputError
        If there is none; the message is the option and `empty`.
    """
    values = list(dict.fromkeys(value.strip() for value in text.split(",") if value.strip()))
    if not values:
        raise InputError(f"{option} {empty or f'is {text!r}; at least one value is needed'}")
    return values
