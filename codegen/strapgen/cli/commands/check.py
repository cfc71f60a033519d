"""strapgen check."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions
from strapgen.cli.output import Format, check_format, print_json


@grouped
def check(
    algorithm: Annotated[
        str,
        typer.Argument(help="A Python file with an algorithm of your own, or dcm, euler or cayley-klein."),
    ],
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    format: Format = "text",
) -> None:
    """Test an algorithm as the project tests its own, and show what holds; exit with 1 if something fails.

    Identities are checked in arithmetic of 40 digits, the order on a ladder of steps, and the back ends against exact
    arithmetic. What stands behind a dash is measured and is yours to judge.

    Example: strapgen check examples/modified_rodrigues.py
    """
    check_format(format)
    choice = method.choose(algorithm)
    from strapgen import pipeline
    from strapgen.experiments import conformance
    from strapgen.reports.conformance import finding_text

    kernel = pipeline.derive(choice)
    if format == "text":
        typer.echo(f"{kernel.name}: {kernel.title}\n")
    findings = []
    for finding in conformance.check(choice):
        findings.append(finding)
        if format == "text":
            typer.echo(finding_text(finding))
    failed = [finding.name for finding in findings if finding.holds is False]
    if format == "json":
        print_json(
            {
                "kernel": kernel.name,
                "holds": not failed,
                "findings": [finding.as_dict() for finding in findings],
            }
        )
    if failed:
        typer.echo(f"strapgen: {kernel.name} fails: {', '.join(failed)}", err=True)
        raise typer.Exit(1)
