"""The command ``strapgen compare`` runs an algorithm on several back ends side by side."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, StepAlgorithm, limit, listed
from strapgen.cli.output import Output
from strapgen.cli.sample_source import SampleSource
from strapgen.support.exceptions import InputError


@grouped
def compare(
    algorithm: StepAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    backends: Annotated[
        str, typer.Option("--backends", metavar="NAME,...", help="Back ends to compare; see strapgen list.")
    ] = "numpy,c,c-float,c-q31,c-q15",
    reference: Annotated[
        str, typer.Option("--reference", help="Back end to compare with; exact computes with 40 digits.")
    ] = "numpy",
    source: SampleSource,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    fail_above: Annotated[
        str | None,
        typer.Option(
            "--fail-above",
            metavar="RAD",
            help="Exit with 1 if a back end departs from the reference by more than this angle in rad.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Output, Shown(only=("out", "format"))],
) -> None:
    """Run an algorithm on several back ends with the same increments, and show how far each is from a reference.

    For each back end the table shows the largest and the rms angle from the reference in rad, for fixed point the
    certified bound, the largest angle in units in the last place, the drift, the time of a step, the bytes of its
    object code and its operations. Fixed-point formats are chosen for the increments of the run, or for
    --max-rate-deg-s if you give it.

    Example:

    \b
      strapgen compare euler --method rk4 --increments 2 \\
        --backends numpy,c,c-q31,c-q15 --carry full --reference exact \\
        --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 \\
        --step 0.125 --duration 180
    """  # noqa: D301
    output.check(algorithm, method.tableau, source.increments_csv, source.rates_csv)
    choice = method.choose(algorithm)
    names = listed("--backends", backends, "names no back end")
    _check_backends(names, reference)
    most = limit("fail-above", fail_above)
    source.check()
    _check_fixed(fixed, {*names, reference})

    import numpy as np

    from strapgen.experiments import comparison
    from strapgen.reports.comparison import comparison_csv, comparison_json, comparison_text

    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        inputs = source.read(choice.increments_per_step, choice.previous)
        rows = comparison.compare(
            choice,
            backends=names,
            increments=inputs.increments,
            reference=reference,
            truth=inputs.truth,
            settings=fixed.at_step(inputs.step).settings(choice.increments_per_step),
        )
    if output.format == "json":
        output.deliver(comparison_json(rows))
    elif output.format == "csv":
        output.deliver(comparison_csv(rows))
    else:
        drift = "drift from the truth" if inputs.truth is not None else f"drift from {reference}"
        output.deliver(comparison_text(rows, f"{choice.kernel}: {inputs.title}", reference, drift))
    beyond = [row for row in rows if most is not None and not row.max_abs_rad <= most]
    if beyond:
        angles = ", ".join(f"{row.backend} {row.max_abs_rad:.3g} rad" for row in beyond)
        typer.echo(f"strapgen: further from {reference} than {fail_above} rad: {angles}", err=True)
        raise typer.Exit(1)


def _check_backends(names: list[str], reference: str) -> None:
    from strapgen.backends import BACKENDS
    from strapgen.support import checks

    for name in names:
        checks.choice("backend", name, BACKENDS)
    checks.choice("reference", reference, BACKENDS)


def _check_fixed(fixed: FixedOptions, backends: set[str]) -> None:
    """Refuse options of fixed point that no back end of the run uses."""
    from strapgen.backends import BACKENDS

    if not any(BACKENDS[name].fixed for name in backends):
        for option in fixed.stated:
            raise InputError(f"{option} is for fixed-point back ends, and none is named")
    if fixed.word is not None and "fixed-model" not in backends:
        raise InputError(
            "--word is for the back end fixed-model, which is not named; the others have their own"
        )
