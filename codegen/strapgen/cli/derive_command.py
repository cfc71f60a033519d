"""The command ``strapgen derive``: formulas or program of a kernel."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Algorithm, MethodOptions, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.rules import Needs, rules
from strapgen.cli.values import names


@grouped
@rules(Needs("--format=csv|markdown", "--show=program|operations"))
def derive(
    algorithm: Algorithm,
    *,
    method: MethodOptions,
    show: Annotated[
        str,
        option(
            "--show",
            metavar="NAME",
            help="What to show: text or latex (the formulas), program, or operations.",
            panel="Output",
            read=names(("text", "latex", "program", "operations")),
        ),
    ] = "text",
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Show the formulas, the program or the operations of a kernel.

    The program is lowered from the formulas. It and the operations are tables, which --format csv, markdown and latex
    write; of the formulas, latex shows a step in vectors.

    Example: strapgen derive euler --method rk4 --increments 2 --show operations
    """
    output.check(algorithm, *method.files)
    choice = method.choose(algorithm, step=False)
    from strapgen import pipeline
    from strapgen.results.display.formulas import formulas_report, unknown_formulas_report

    kernel = pipeline.derive(choice)
    if kernel.unknowns and show in ("text", "latex"):
        output.report(unknown_formulas_report(kernel, show))
        return
    output.report(formulas_report(kernel, pipeline.program(choice), show))
