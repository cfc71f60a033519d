"""strapgen tableau."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from strapgen.cli.output import Format, check_format, print_json
from strapgen.support import checks


def tableau(
    method: Annotated[
        str,
        typer.Argument(metavar="NAME|FILE", help="A method of strapgen list, or a TOML file with a tableau."),
    ],
    format: Format = "text",
) -> None:
    """Show a Butcher tableau, and what its order conditions say when they are evaluated exactly.

    A file is what ends in .toml or holds a path separator. Its keys are those of the files in
    strapgen/catalogue/methods: name, source, order, nodes, matrix, weights, embedded_weights, tolerance.

    Example: strapgen tableau dormand-prince5
    """
    check_format(format)
    from strapgen.catalogue.methods import tableaux
    from strapgen.reports import tableau as reports

    if method.endswith(".toml") or any(separator in method for separator in (os.sep, os.altsep) if separator):
        chosen = tableaux.read(method)
    else:
        chosen = tableaux.TABLEAUX[checks.choice("method", method, tableaux.TABLEAUX)]
        tableaux.verify(chosen)
    data = reports.tableau_data(chosen)
    if format == "json":
        print_json(data)
    else:
        typer.echo(reports.tableau_text(data))
