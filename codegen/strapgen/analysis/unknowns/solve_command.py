"""The commands ``strapgen solve`` and ``strapgen tableau``: conditions, their solutions, and Butcher tableaux."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import MethodOptions, argument, option
from strapgen.cli.output import TEXT_OUTPUT, Output, format_option
from strapgen.cli.progress import waiting
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

if TYPE_CHECKING:
    from strapgen.catalogue.methods.tableaux import Tableau


_Text = str | None


@dataclass(frozen=True)
class SolutionOutput(Output):
    """Options for the output of the families."""

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
            help="Motions on which the step has the order N, by default that of --order: general (any smooth motion); "
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
    nodes, or one of velocity and position. You see the conditions, every family of coefficients that satisfies them
    with its free parameters, and its leading error. Linear conditions are solved exactly, polynomial ones by
    elimination and Groebner bases within stated limits. If there is no solution, the answer says why.

    Example: strapgen solve examples/three_samples.py --order 5 --on polynomial

    Example: strapgen solve examples/three_samples.py --order 4 --set a=57/80
    """
    output.check(algorithm, *method.files)
    orders = _orders(on, order)
    choice = method.choose(algorithm, step=False)
    from strapgen.analysis.unknowns import solving
    from strapgen.analysis.unknowns.unknowns_report import SolvedResult

    with waiting(f"solving the conditions of {algorithm}"):
        solved = solving.solve(choice, orders)
    chosen = None
    if settings:
        if not solved.families:
            raise InputError(f"--set: {solved.solution.reason}; there is no solution")
        number = checks.count("family", family, largest=len(solved.families))
        chosen = solved.values(settings, number - 1)
    output.show(SolvedResult.of(solved, chosen))


def _orders(on: tuple[str, ...], order: int) -> dict[str, int]:
    """Return the motions of the option --on, each with its order."""
    orders: dict[str, int] = {}
    for text in on:
        name, equals, number = text.partition("=")
        if name in orders:
            raise InputError(f"--on has {name} twice; one order is needed")
        orders[name] = checks.whole("--on", number) if equals else order
    return orders


@dataclass(frozen=True)
class TableauOutput(Output):
    """Options for the output of the tableau."""

    format: Annotated[str | None, format_option((*Output.formats, "toml"))] = "text"
    formats: ClassVar[tuple[str, ...]] = (*Output.formats, "toml")


@grouped
def tableau(
    method: Annotated[
        str,
        argument(
            "NAME|FILE",
            help="A Runge-Kutta method that strapgen list methods shows, or a TOML file with a tableau.",
            words="strapgen.catalogue.methods.tableaux:TABLEAUX",
        ),
    ],
    *,
    settings: Annotated[
        dict[str, str] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the family of a tableau with unknowns; shows its member.",
            panel="Input",
        ),
    ] = None,
    family: Annotated[
        int, option("--family", metavar="N", help="Number of the family for --set.", panel="Input")
    ] = 1,
    output: Annotated[TableauOutput, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Show a Butcher tableau with its order, checked exactly.

    You see the order on general equations and the order on attitude kinematics, which may be higher.

    An argument that ends in .toml or holds a path separator is read as a file. Its keys are those of the files in
    strapgen/catalogue/methods/butcher_tableaux: name, source, order, nodes, matrix, weights, embedded_weights,
    tolerance.

    A file with the key unknowns, a list of names, may have these in its coefficients. You then see all families of
    methods that have the order, on general equations and on x' = A(t) x; --set chooses a member, which --format toml
    writes as a file for --tableau.

    Example: strapgen tableau dormand-prince5

    Example: strapgen tableau examples/kutta4.toml --set c2=1/3 c3=2/3 --format toml
    """
    output.check(method)
    from strapgen.analysis.unknowns import unknown_tableau
    from strapgen.analysis.unknowns.tableau_report import TableauResult, toml_text
    from strapgen.catalogue.methods import tableaux

    is_file = streams.names_file(method)
    if is_file and unknown_tableau.has_unknowns(method):
        if not settings:
            _families(method, output)
            return
        butcher = _member(method, settings, family)
    elif settings:
        raise InputError(f"--set goes with a file of unknowns; {method} has none")
    elif is_file:
        butcher = tableaux.read(method)
    else:
        butcher = tableaux.TABLEAUX[checks.choice("method", method, tableaux.TABLEAUX)]
        tableaux.verify(butcher)
    if output.format == "toml":
        output.deliver(toml_text(butcher))
    else:
        output.show(TableauResult.of(butcher))


def _families(method: str, output: Output) -> None:
    """Deliver the families of a tableau with unknowns."""
    from strapgen.analysis.unknowns import unknown_tableau
    from strapgen.analysis.unknowns.tableau_report import FamiliesResult

    if output.format not in ("text", "json", "latex"):
        raise InputError(f"--format {output.format} goes with --set; families are text, json or latex")
    unknown = unknown_tableau.read(method)
    with waiting(f"solving the conditions of {method}"):
        solutions = {equations: unknown.solve(equations) for equations in unknown_tableau.EQUATIONS}
    output.show(FamiliesResult.of(unknown, solutions))


def _member(method: str, settings: dict[str, str], family: int) -> Tableau:
    """Return a member of a family of a tableau with unknowns."""
    from strapgen.analysis.unknowns import unknown_tableau

    unknown = unknown_tableau.read(method)
    with waiting(f"solving the conditions of {method}"):
        solution = unknown.solve()
    if not solution.families:
        raise InputError(f"{method} has no solution of order {unknown.order}: {solution.reason}")
    number = checks.count("family", family, largest=len(solution.families))
    return unknown.member(solution.families[number - 1], settings)
