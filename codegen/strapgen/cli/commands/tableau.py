"""The command ``strapgen tableau`` shows a Butcher tableau with its order."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.support import checks


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
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Show a Butcher tableau with its order, checked exactly.

    You see the order on general equations and the order on attitude kinematics, which may be higher.

    An argument that ends in .toml or holds a path separator is read as a file. Its keys are those of the files in
    strapgen/catalogue/methods/butcher_tableaux: name, source, order, nodes, matrix, weights, embedded_weights,
    tolerance.

    Example: strapgen tableau dormand-prince5
    """
    output.check(method)
    from strapgen.catalogue.methods import tableaux
    from strapgen.reports.tableau import tableau_data, tableau_report

    if method.endswith(".toml") or any(separator in method for separator in (os.sep, os.altsep) if separator):
        butcher = tableaux.read(method)
    else:
        butcher = tableaux.TABLEAUX[checks.choice("method", method, tableaux.TABLEAUX)]
        tableaux.verify(butcher)
    output.report(tableau_report(tableau_data(butcher), butcher))
