"""strapgen series."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.options import (
    Increments,
    Method,
    Previous,
    StepAlgorithm,
    TableauFile,
    check_format,
    chosen,
    print_json,
    whole,
)


def series(
    algorithm: StepAlgorithm,
    method: Method = None,
    tableau: TableauFile = None,
    increments: Increments = None,
    previous: Previous = None,
    motion: Annotated[
        str,
        typer.Option("--motion", help="general, or constant, sinusoidal, coning or polynomial."),
    ] = "general",
    terms: Annotated[
        str,
        typer.Option(
            "--terms", metavar="N", help="Terms of drift, scale and skew that are not zero, 1 to 6."
        ),
    ] = "2",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="text, latex or json.")] = "text",
) -> None:
    """Show what one step loses: drift, scale and skew as exact power series in the step length h.

    For the general smooth rate w0 + w1 t + w2 t^2/2 + ... in vector-invariant form, S(a, b) = a b' + b a'; for the
    motions of the catalogue in their own symbols, t the time at the beginning of the step.

    Example: strapgen series euler --method rk4 --increments 2 --motion constant
    """
    check_format(format, "latex")
    choice = chosen(algorithm, method, tableau, increments, previous)
    count = whole("terms", terms)
    from strapgen import output
    from strapgen.analysis import series as analysis

    found = analysis.series(choice, motion, 2 if count is None else count)
    if format == "json" and out is None:
        print_json(found.as_dict())
        return
    text = analysis.as_json(found) if format == "json" else analysis.as_report(found, latex=format == "latex")
    if out is None:
        typer.echo(text)
    else:
        output.write_files(Path(), {str(out): f"{text}\n"})
