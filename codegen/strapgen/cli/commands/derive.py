"""strapgen derive."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.options import (
    Algorithm,
    Format,
    Increments,
    Method,
    Previous,
    Rates,
    TableauFile,
    check_format,
    chosen,
    print_json,
)
from strapgen.support import checks


def derive(
    algorithm: Algorithm,
    method: Method = None,
    tableau: TableauFile = None,
    increments: Increments = None,
    previous: Previous = None,
    rates: Rates = False,
    show: Annotated[str, typer.Option("--show", help="text, latex, program or operations.")] = "text",
    format: Format = "text",
) -> None:
    """Show a kernel: its formulas as text or LaTeX, the program lowered from them, or how much that computes.

    Example: strapgen derive euler --method rk4 --increments 2 --show operations
    """
    check_format(format)
    checks.choice("show", show, ("text", "latex", "program", "operations"))
    choice = chosen(algorithm, method, tableau, increments, previous, rates, step=False)
    from strapgen import pipeline
    from strapgen.library import generated_sources
    from strapgen.reports import formulas

    kernel = pipeline.derive(choice)
    program = generated_sources.program(choice)
    if format == "json":
        data = formulas.as_data(kernel, program)
        if show == "latex":
            data["latex"] = formulas.as_latex(kernel)
        elif show == "program":
            data["program"] = formulas.program_as_data(program)
        print_json(data)
    elif show == "text":
        typer.echo(formulas.as_text(kernel, program.notes))
    elif show == "latex":
        typer.echo(formulas.as_latex(kernel))
    elif show == "program":
        typer.echo(formulas.program_as_text(program))
    else:
        typer.echo(formulas.operations_as_text(kernel, program))
