"""strapgen compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.fixed_options import Allowance, Carry, MaxRate, Rounding, Word, read_settings
from strapgen.cli.inputs import (
    Duration,
    IncrementsFile,
    MotionName,
    MotionSettings,
    Pulse,
    RatesFile,
    RateUnit,
    ResampleHz,
    RunStep,
    arcseconds,
    check_source,
    read_inputs,
)
from strapgen.cli.options import (
    Increments,
    Method,
    Previous,
    StepAlgorithm,
    TableauFile,
    check_format,
    chosen,
)
from strapgen.support.exceptions import InputError


def compare(
    algorithm: StepAlgorithm,
    method: Method = None,
    tableau: TableauFile = None,
    increments: Increments = None,
    previous: Previous = None,
    backends: Annotated[
        str, typer.Option("--backends", metavar="NAME,...", help="Back ends to compare; see strapgen list.")
    ] = "numpy,c,c-float,c-q31,c-q15",
    reference: Annotated[
        str, typer.Option("--reference", help="Back end to compare with; exact has 40 digits.")
    ] = "numpy",
    motion: MotionName = None,
    settings: MotionSettings = None,
    step: RunStep = None,
    duration: Duration = None,
    increments_csv: IncrementsFile = None,
    rates_csv: RatesFile = None,
    rate_unit: RateUnit = None,
    resample_hz: ResampleHz = None,
    pulse_arcsec: Pulse = None,
    word: Word = None,
    max_rate_deg_s: MaxRate = None,
    rounding: Rounding = None,
    carry: Carry = None,
    drift_allowance: Allowance = None,
    fail_above: Annotated[
        str | None,
        typer.Option(
            "--fail-above",
            metavar="RAD",
            help="Exit with 1 if a back end is further from the reference.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="text, json or csv.")] = "text",
) -> None:
    """Run an algorithm on several back ends in lock-step and show how far each is from a reference.

    Angles in rad, in units of the last place, and for fixed point beside the certified bound; drift, time a step,
    operations and bytes of object code. Formats of fixed point are chosen for the increments of the run, or for
    --max-rate-deg-s.

    Example:

    \b
      strapgen compare euler --method rk4 --increments 2 \\
        --backends numpy,c,c-q31,c-q15 --carry full --reference exact \\
        --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 \\
        --step 0.125 --duration 180
    """  # noqa: D301
    check_format(format, "csv")
    from strapgen.backends import BACKENDS
    from strapgen.support import checks
    from strapgen.support.files import write_files
    from strapgen.targets import FIXED

    choice = chosen(algorithm, method, tableau, increments, previous)
    samples = choice.increments_per_step
    names = list(dict.fromkeys(name.strip() for name in backends.split(",") if name.strip()))
    for name in names:
        checks.choice("backend", name, BACKENDS)
    if not names:
        raise InputError("--backends names no back end")
    checks.choice("reference", reference, BACKENDS)
    limit = None if fail_above is None else float(checks.number("fail-above", fail_above))
    check_source(motion, settings, step, duration, increments_csv, rates_csv, rate_unit, resample_hz)
    stated = {
        "word": word,
        "max_rate_deg_s": max_rate_deg_s,
        "rounding": rounding,
        "carry": carry,
        "drift_allowance": drift_allowance,
    }
    if not any(BACKENDS[name].target in FIXED for name in (*names, reference)):
        for option, value in stated.items():
            if value is not None:
                raise InputError(
                    f"--{option.replace('_', '-')} is for fixed-point back ends, and none is named"
                )

    if word is not None and "fixed-model" not in (*names, reference):
        raise InputError(
            "--word is for the back end fixed-model, which is not named; the others have their own"
        )
    if limit is not None and limit < 0:
        raise InputError(f"fail-above is {fail_above}; a number that is not below 0 is needed")

    import numpy as np

    from strapgen.experiments import comparison
    from strapgen.reports.comparison import comparison_csv, comparison_json, comparison_text

    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        inputs = read_inputs(
            samples,
            motion,
            settings,
            step,
            duration,
            increments_csv,
            rates_csv,
            rate_unit,
            resample_hz,
            arcseconds(pulse_arcsec),
            choice.previous,
        )
        length = None if max_rate_deg_s is None else repr(inputs.step)
        rows = comparison.compare(
            choice,
            backends=names,
            increments=inputs.increments,
            reference=reference,
            truth=inputs.truth,
            settings=read_settings(samples, **stated, step=length),
        )
    if format == "json":
        text = comparison_json(rows)
    elif format == "csv":
        text = comparison_csv(rows)
    else:
        drift = "drift from the truth" if inputs.truth is not None else f"drift from {reference}"
        text = comparison_text(rows, f"{choice.kernel}: {inputs.title}", reference, drift)
    text = text.rstrip("\n")
    if out is None:
        typer.echo(text)
    else:
        write_files(Path(), {str(out): f"{text}\n"})
    beyond = [row for row in rows if limit is not None and not row.max_abs_rad <= limit]
    if beyond:
        said = ", ".join(f"{row.backend} {row.max_abs_rad:.3g} rad" for row in beyond)
        typer.echo(f"strapgen: further from {reference} than {fail_above} rad: {said}", err=True)
        raise typer.Exit(1)
