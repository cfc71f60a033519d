"""The command ``strapgen check`` tests a step and exits with 1 if it fails."""

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
        typer.Argument(help="A Python file with your own algorithm, or dcm, euler or cayley-klein."),
    ],
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    format: Format = "text",
) -> None:
    """Test an algorithm by the behaviour that every attitude step must show; exit with 1 if a test fails.

    Identities are checked in arithmetic of 40 digits, the order is measured on a ladder of step lengths, and every back
    end is compared with exact arithmetic. A line that begins with a dash is a measurement that has no limit to pass.

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
