"""The command ``strapgen derive`` shows the formulas or the program of a kernel."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import Algorithm, MethodOptions
from strapgen.cli.output import Format, check_format, print_json
from strapgen.support import checks


@grouped
def derive(
    algorithm: Algorithm,
    *,
    method: MethodOptions,
    show: Annotated[
        str,
        typer.Option("--show", help="What to show: text or latex (the formulas), program, or operations."),
    ] = "text",
    format: Format = "text",
) -> None:
    """Derive a kernel and show its formulas, the program lowered from them, or its number of operations.

    Example: strapgen derive euler --method rk4 --increments 2 --show operations
    """
    check_format(format)
    checks.choice("show", show, ("text", "latex", "program", "operations"))
    choice = method.choose(algorithm, step=False)
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
