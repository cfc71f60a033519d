"""The command ``strapgen tableau`` shows a Butcher tableau with its order, or solves for the unknowns of one."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import option
from strapgen.cli.output import TEXT_OUTPUT, Output, format_option
from strapgen.cli.progress import waiting
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.tableaux import Tableau


@dataclass(frozen=True)
class TableauOutput(Output):
    """Where the tableau goes, and in which format."""

    format: Annotated[str | None, format_option((*Output.formats, "toml"))] = "text"
    formats: ClassVar[tuple[str, ...]] = (*Output.formats, "toml")


@grouped
def tableau(
    method: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE",
            help="A Runge-Kutta method that strapgen list methods shows, or a TOML file with a tableau.",
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
    from strapgen.analysis.tableau.tableau_report import TableauResult
    from strapgen.analysis.unknowns import unknown_tableau
    from strapgen.analysis.unknowns.tableau_families_report import toml_text
    from strapgen.catalogue.methods import tableaux

    is_file = method.endswith(".toml") or any(mark in method for mark in (os.sep, os.altsep) if mark)
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
    from strapgen.analysis.unknowns.tableau_families_report import FamiliesResult

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
