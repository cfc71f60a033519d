"""strapgen derive."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen import checks
from strapgen.cli.options import Algorithm, Format, Increments, Method, Rates, check_format, print_json, whole


def derive(
    algorithm: Algorithm,
    method: Method = None,
    increments: Increments = None,
    rates: Rates = False,
    show: Annotated[str, typer.Option("--show", help="text, latex, program or operations.")] = "text",
    format: Format = "text",
) -> None:
    """Show a kernel: its formulas as text or LaTeX, the program lowered from them, or how much that computes.

    Example: strapgen derive euler --method rk4 --increments 2 --show operations
    """
    check_format(format)
    checks.choice("show", show, ("text", "latex", "program", "operations"))
    from strapgen import formulas, pipeline

    kernel = pipeline.derive(algorithm, method, whole("increments", increments), rates=rates)
    program = pipeline.lower(kernel)
    if format == "json":
        data = formulas.as_data(kernel, program)
        if show == "latex":
            data["latex"] = formulas.as_latex(kernel)
        elif show == "program":
            data["program"] = formulas.program_as_data(program)
        print_json(data)
    elif show == "text":
        typer.echo(formulas.as_text(kernel))
    elif show == "latex":
        typer.echo(formulas.as_latex(kernel))
    elif show == "program":
        typer.echo(formulas.program_as_text(program))
    else:
        counts = {**program.operations, "temporaries": program.temporaries}
        typer.echo("\n".join([kernel.name, *(f"  {kind:<12}{number:>5}" for kind, number in counts.items())]))
