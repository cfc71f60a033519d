"""The command ``strapgen check`` tests a step and exits with 1 if it fails."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, StepAlgorithm
from strapgen.cli.output import TEXT_OUTPUT, Output


@grouped
def check(
    algorithm: StepAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Test what every attitude step must do; exit with 1 if it fails.

    Identities are checked in arithmetic of 40 digits, the order is measured on a ladder of step lengths, and every back
    end is compared with exact arithmetic. A line that begins with a dash is a measurement that has no limit to pass.

    Example: strapgen check examples/modified_rodrigues.py
    """
    output.check(algorithm, method.tableau)
    choice = method.choose(algorithm)
    from strapgen import pipeline
    from strapgen.experiments import conformance
    from strapgen.reports.conformance import finding_text, findings_report

    kernel = pipeline.derive(choice)
    live = (
        output.format == "text" and output.file is None
    )  # a person sees each finding as soon as it is there
    if live:
        typer.echo(f"{kernel.name}: {kernel.title}\n")
    findings = []
    for finding in conformance.check(choice):
        findings.append(finding)
        if live:
            typer.echo(finding_text(finding))
    if not live:
        output.report(findings_report(kernel.name, kernel.title, findings))
    failed = [finding.name for finding in findings if finding.holds is False]
    if failed:
        typer.echo(f"strapgen: {kernel.name} fails: {', '.join(failed)}", err=True)
        raise typer.Exit(1)
