"""The command ``strapgen tableau`` shows a Butcher tableau with its order."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from strapgen.cli.output import Format, check_format, print_json
from strapgen.support import checks


def tableau(
    method: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE",
            help="A Runge-Kutta method that strapgen list shows, or a TOML file with a tableau.",
        ),
    ],
    format: Format = "text",
) -> None:
    """Show a Butcher tableau, with its order on general equations and on attitude kinematics, checked exactly.

    An argument that ends in .toml or holds a path separator is read as a file. Its keys are those of the files in
    strapgen/catalogue/methods/butcher_tableaux: name, source, order, nodes, matrix, weights, embedded_weights,
    tolerance.

    Example: strapgen tableau dormand-prince5
    """
    check_format(format)
    from strapgen.catalogue.methods import tableaux
    from strapgen.reports.tableau import tableau_data, tableau_text

    if method.endswith(".toml") or any(separator in method for separator in (os.sep, os.altsep) if separator):
        butcher = tableaux.read(method)
    else:
        butcher = tableaux.TABLEAUX[checks.choice("method", method, tableaux.TABLEAUX)]
        tableaux.verify(butcher)
    data = tableau_data(butcher)
    if format == "json":
        print_json(data)
    else:
        typer.echo(tableau_text(data))
