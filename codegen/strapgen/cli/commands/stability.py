"""The command ``strapgen stability`` shows at which constant rates a step contracts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import MethodOptions, StepAlgorithm, listed
from strapgen.cli.output import Output, as_json


@dataclass(frozen=True)
class GrowthOutput(Output):
    """Where the growth of the state is shown: as text or JSON on the terminal, and in an image file."""

    format: Annotated[str | None, typer.Option("--format", help="Format of the output: text or json.")] = (
        "text"
    )
    formats: ClassVar[tuple[str, ...]] = ("text", "json")


@grouped
def stability(
    algorithm: StepAlgorithm,
    *,
    methods: Annotated[
        str | None,
        typer.Option(
            "--method",
            metavar="NAME,...",
            help="Integration methods.  [default: rk1,rk2,rk3,rk4; for a Python file, the method it chooses]",
            show_default=False,
        ),
    ] = None,
    output: Annotated[GrowthOutput, Shown(only=("plot", "format"))],
) -> None:
    """Show at which constant rates a step lets the state grow, and at which it does not.

    At a constant rate w a step of length h turns by the angle x = |w| h. It stretches the part of the state across the
    axis by a factor, whose square is shown exactly, with the angles x at which the factor is at most 1.

    Example: strapgen stability dcm --method rk3,rk4,butcher5 --plot out/stability.png
    """
    output.check(algorithm)
    from strapgen import catalogue
    from strapgen.support import checks

    ours = algorithm in catalogue.ALGORITHMS
    names: list[str | None] = [*catalogue.STANDARD_METHODS] if ours else [None]
    if methods is not None:
        names = [
            checks.choice("method", name, catalogue.METHODS)
            for name in listed("--method", methods, "names no method")
        ]
    choices = []
    for name in names:
        enough = str(catalogue.enough(name)) if ours and name else None
        choices.append(MethodOptions(method=name, increments=enough).choose(algorithm))
    from strapgen.analysis import growth
    from strapgen.reports.growth import stability_text

    steps = [growth.stability(choice) for choice in choices]
    image = None
    if output.plot is not None:
        from strapgen.reports import plots

        title = "constant rate: growth of the state in a step, and where it contracts"
        image = plots.stability_image(steps, title, output.plot)
    if output.format == "json":
        output.deliver(as_json([step.as_dict() for step in steps]), image)
    else:
        output.deliver(stability_text(steps), image)
