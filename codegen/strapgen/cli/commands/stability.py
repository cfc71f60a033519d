"""strapgen stability."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.options import Format, StepAlgorithm, check_format, chosen, print_json
from strapgen.support.exceptions import InputError


def stability(
    algorithm: StepAlgorithm,
    methods: Annotated[
        str | None,
        typer.Option(
            "--method",
            metavar="NAME,...",
            help="Integration methods.  [default: rk1,rk2,rk3,rk4; that of an algorithm of your own]",
            show_default=False,
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Image file for the plot.", show_default=False)
    ] = None,
    format: Format = "text",
) -> None:
    """Show at which constant rates a step lets the state grow, and at which it contracts.

    The square of the factor by which a step of the angle x = |w| h stretches the state across the axis, exactly, and
    the angles at which it is at most 1.

    Example: strapgen stability dcm --method rk3,rk4,butcher5 --plot out/stability.png
    """
    check_format(format)
    from strapgen import catalogue
    from strapgen.support import checks
    from strapgen.support.files import write_files

    ours = algorithm in catalogue.ALGORITHMS
    names: list[str | None] = [*catalogue.STANDARD_METHODS] if ours else [None]
    if methods is not None:
        given = list(dict.fromkeys(name.strip() for name in methods.split(",") if name.strip()))
        if not given:
            raise InputError("--method names no method")
        names = [checks.choice("method", name, catalogue.METHODS) for name in given]
    choices = []
    for name in names:
        enough = str(catalogue.enough(name)) if ours and name else None
        choices.append(chosen(algorithm, name, None, enough, None))
    from strapgen.analysis import growth
    from strapgen.reports.growth import stability_text

    found = [growth.stability(choice) for choice in choices]
    if plot is not None:
        from strapgen.reports import plots

        title = "constant rate: growth of the state in a step, and where it contracts"
        write_files(Path(), {str(plot): plots.stability_image(found, title, plot)})
    if format == "json":
        print_json([one.as_dict() for one in found])
        return
    typer.echo(stability_text(found))
