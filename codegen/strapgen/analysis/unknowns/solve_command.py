"""The command ``strapgen solve`` states the conditions on unknown coefficients and solves them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import MethodOptions, option
from strapgen.cli.output import Output, format_option
from strapgen.cli.progress import waiting
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

_Text = str | None


@dataclass(frozen=True)
class SolutionOutput(Output):
    """Where the families go, and in which format."""

    format: Annotated[_Text, format_option(("text", "json", "latex"))] = "text"
    formats: ClassVar[tuple[str, ...]] = ("text", "json", "latex")


@grouped
def solve(
    algorithm: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="A Python file with an algorithm of your own that has unknowns.",
            show_default=False,
        ),
    ],
    *,
    order: Annotated[
        int,
        option(
            "--order",
            metavar="N",
            help="Order that the step is to have: its error vanishes up to h^N.",
            panel="Input",
        ),
    ],
    on: Annotated[
        tuple[str, ...],
        option(
            "--on",
            metavar="MOTION=N,...",
            help="Motions on which it is to have the order N, without =N that of --order: general (any smooth motion); "
            "polynomial, of the degree that the samples determine; coning, or sculling of a velocity. The last three "
            "hold to products of two vectors. velocity or position: any smooth motion, and that change alone.",
            panel="Input",
        ),
    ] = ("general",),
    settings: Annotated[
        dict[str, str] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Value of a free parameter; shows the member of the family that has it.",
            panel="Input",
        ),
    ] = None,
    family: Annotated[
        int, option("--family", metavar="N", help="Number of the family for --set.", panel="Input")
    ] = 1,
    method: Annotated[MethodOptions, Shown(only=("method", "tableau", "increments", "previous", "ahead"))],
    output: Annotated[SolutionOutput, Shown(only=("out", "format"))],
) -> None:
    """Solve the conditions on the unknown coefficients of an algorithm.

    An algorithm declares them with KernelBuilder.parameter. It is a step of attitude, on increments or on rates at
    nodes, or one of velocity and position. You see the conditions, every family of coefficients that
    satisfies them, with its free parameters, and the leading error that it leaves. Linear conditions are solved
    exactly, polynomial ones by elimination and Groebner bases within stated limits. If there is no solution, the answer
    says why.

    Example: strapgen solve examples/three_samples.py --order 5 --on polynomial

    Example: strapgen solve examples/three_samples.py --order 4 --set a=57/80
    """
    output.check(algorithm, *method.files)
    orders = _orders(on, order)
    choice = method.choose(algorithm, step=False)
    from strapgen.analysis.unknowns import solving
    from strapgen.analysis.unknowns.unknowns_report import solved_report

    with waiting(f"solving the conditions of {algorithm}"):
        solved = solving.solve(choice, orders)
    chosen = None
    if settings:
        if not solved.families:
            raise InputError(f"--set: {solved.solution.reason}; there is no solution")
        number = checks.count("family", family, largest=len(solved.families))
        chosen = solved.values(settings, number - 1)
    output.report(solved_report(solved, chosen))


def _orders(on: tuple[str, ...], order: int) -> dict[str, int]:
    """Return the motions of the option --on, each with its order."""
    orders: dict[str, int] = {}
    for text in on:
        name, equals, number = text.partition("=")
        if name in orders:
            raise InputError(f"--on has {name} twice; one order is needed")
        orders[name] = checks.whole("--on", number) if equals else order
    return orders
