"""The command ``strapgen stability`` shows at which constant rates a step contracts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, Samples, SeveralMethods, StepAlgorithm, option, samples
from strapgen.cli.output import Output


@dataclass(frozen=True)
class SteppedMethods(SeveralMethods):
    """Options that choose the methods whose growth is shown side by side."""

    method: Annotated[
        tuple[str, ...] | None,
        option(
            "--method",
            metavar="NAME,...",
            help="Integration methods, with commas between; strapgen list methods shows all.  "
            "[default: rk1,rk2,rk3,rk4; for a Python file, the method it chooses]",
        ),
    ] = None
    increments: Annotated[
        tuple[Samples, ...] | None,
        option(
            "--increments",
            metavar="N,...",
            help="Numbers of angle increments in a step, 1 to 8; enough: as many as each method needs.  "
            "[default: enough]",
            read=samples,
        ),
    ] = None


@grouped
def stability(
    algorithm: StepAlgorithm,
    *,
    methods: Annotated[SteppedMethods, Shown(only=STEP_OPTIONS)],
    output: Output,
) -> None:
    """Show at which constant rates the state grows in a step.

    At a constant rate w a step of length h turns by the angle x = |w| h. It stretches the part of the state across the
    axis by a factor, whose square is shown exactly, with the angles x at which the factor is at most 1.

    Example: strapgen stability dcm --method rk3,rk4,butcher5 --plot out/stability.png
    """
    output.check(algorithm, *methods.files)
    from strapgen import catalogue

    if algorithm in catalogue.ALGORITHMS:
        if methods.method is None and not any(methods.files):
            methods = replace(methods, method=tuple(catalogue.STANDARD_METHODS))
        if methods.increments is None:
            methods = replace(methods, increments=("enough",))
    choices = methods.choices(algorithm)
    from strapgen.analysis.growth import growth
    from strapgen.analysis.growth.growth_plot import stability_image
    from strapgen.analysis.growth.growth_report import stability_report

    steps = [growth.stability(choice) for choice in choices]
    title = "constant rate: growth of the state in a step, and where it contracts"
    output.report(stability_report(steps), lambda path: stability_image(steps, title, path))
