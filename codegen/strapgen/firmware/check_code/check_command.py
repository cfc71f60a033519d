"""The command ``strapgen check`` tests a step and exits with 1 if it fails."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import typer

from strapgen.cli.option_groups import Shown, grouped, stated
from strapgen.cli.options import STEP_OPTIONS, CheckedAlgorithm, MethodOptions
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.firmware.check_code.foreign_options import ForeignOptions
from strapgen.ir.exceptions import InputError


@grouped
def check(
    algorithm: CheckedAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    foreign: ForeignOptions,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Test what every attitude step must do; exit with 1 if it fails.

    Identities are checked in arithmetic of 40 digits, the order is measured on a ladder of step lengths, and every back
    end is compared with exact arithmetic. A line that begins with a dash is a measurement that has no limit to pass.

    A function in a file of C or C++ is compiled, run along motions with known attitude, and held to the same behaviour.
    If it fails, the likely cause is named.

    Example: strapgen check examples/modified_rodrigues.py

    Example: strapgen check examples/check_foreign_c/correct.c --function integrator_update
    --arguments "state[4], increments[3] -> state[4]" --scalar first --init integrator_init
    """
    output.check(algorithm, *method.files)
    from strapgen.firmware.check_code.foreign_arguments import FOREIGN_SUFFIXES, is_foreign

    if is_foreign(algorithm):
        _refuse(stated(method), f"goes with an algorithm of strapgen; {algorithm} is a file in C or C++")
        _check_foreign(algorithm, foreign, output)
    else:
        _refuse(
            stated(foreign),
            f"goes with a file in C or C++ ({', '.join(FOREIGN_SUFFIXES)}); {algorithm} is none",
        )
        _check_step(algorithm, method, output)


def _refuse(options: Iterable[str], reason: str) -> None:
    """Refuse options that do not go with what is checked."""
    for option in options:
        raise InputError(f"{option} {reason}")


def _check_step(algorithm: str, method: MethodOptions, output: Output) -> None:
    """Check an attitude step of the catalogue or of a user."""
    choice = method.choose(algorithm)
    from strapgen import pipeline
    from strapgen.firmware.check_code import conformance
    from strapgen.firmware.check_code.conformance_report import finding_text, findings_report

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
    _fail(kernel.name, [finding.name for finding in findings if finding.holds is False])


def _check_foreign(file: str, foreign: ForeignOptions, output: Output) -> None:
    """Check a function of a file in C or C++."""
    step = foreign.step(file)
    from strapgen.firmware.check_code.check_foreign import check_foreign
    from strapgen.firmware.check_code.conformance_report import outcome_report

    outcome = check_foreign(step)
    output.report(outcome_report(outcome, step.source.function))
    cause = f"; likely cause: {outcome.cause}" if outcome.cause else ""
    _fail(file, [finding.name for finding in outcome.findings if finding.holds is False], cause)


def _fail(name: str, failed: list[str], cause: str = "") -> None:
    """End with status 1 if anything fails."""
    if failed:
        typer.echo(f"strapgen: {name} fails: {', '.join(failed)}{cause}", err=True)
        raise typer.Exit(1)
