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
    show: Annotated[str, typer.Option("--show", help="text, latex or operations.")] = "text",
    format: Format = "text",
) -> None:
    """Show a kernel: its formulas as text or LaTeX, or the operations of its code.

    Example: strapgen derive euler --method rk4 --increments 2 --show operations
    """
    check_format(format)
    checks.choice("show", show, ("text", "latex", "operations"))
    from strapgen import formulas, pipeline

    kernel = pipeline.derive(algorithm, method, whole("increments", increments), rates=rates)
    program = pipeline.lower(kernel)
    if format == "json":
        data = formulas.as_data(kernel, program)
        print_json(data | {"latex": formulas.as_latex(kernel)} if show == "latex" else data)
    elif show == "text":
        typer.echo(formulas.as_text(kernel))
    elif show == "latex":
        typer.echo(formulas.as_latex(kernel))
    else:
        counts = {**program.operations, "temporaries": program.temporaries}
        typer.echo("\n".join([kernel.name, *(f"  {kind:<12}{number:>5}" for kind, number in counts.items())]))
