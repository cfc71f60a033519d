"""The command ``strapgen study redundancy`` counts what redundancy management makes of failing sensors."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import filled, names, whole


@grouped
def study_redundancy(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="TOML file with axes.  [default: the hexad of 1984]", show_default=False
        ),
    ] = None,
    *,
    trials: Annotated[
        int,
        option(
            "--trials",
            metavar="N",
            help="Trials for every size of a failure.",
            panel="Run",
            read=whole(1, 1_000_000),
        ),
    ] = 2000,
    seed: Annotated[
        int, option("--seed", metavar="N", help="Seed of the random numbers.", panel="Run", read=whole(0))
    ] = 1,
    backend: Annotated[
        str,
        option(
            "--backend",
            metavar="NAME",
            help="Back end: numpy, c or c-float.",
            panel="Run",
            read=names(("numpy", "c", "c-float")),
        ),
    ] = "numpy",
    settings: Annotated[
        dict[str, Fraction] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Errors and trip levels: cycle_s, rate_deg_s, load_g, noise_arcsec, pulse_arcsec, bias_deg_h, "
            "scale_ppm, bending_arcmin_g, trip_sigmas, trip_rate.",
            panel="Input",
        ),
    ] = None,
    output: Output,
) -> None:
    """Count detected, isolated and missed failures of redundant gyros by Monte Carlo.

    Sensors with quantization, noise, bias, scale factor errors and bending fail one after the other, by steps of many
    sizes. You see how often an equation fails, which sensor is isolated, and whether the triad is sound: by the rule of
    the kernel and by the tables.

    Example: strapgen study redundancy --trials 500 --plot out/redundancy.png
    """
    output.check(file)
    from strapgen.navigation.redundancy.geometry_file import read
    from strapgen.navigation.redundancy.parity_equations import HEXAD_SET
    from strapgen.navigation.redundancy.redundancy_study import SensorErrors, redundancy_study, study_steps
    from strapgen.navigation.redundancy.redundancy_study_report import redundancy_image, redundancy_report

    errors = filled(SensorErrors, settings)
    sensors = HEXAD_SET if file is None else read(file)
    steps = redundancy_study(sensors, errors, trials, seed, backend)
    rows = list(track(steps, "running", len(study_steps(sensors.geometry))))
    output.report(
        redundancy_report(sensors, errors, rows), lambda path: redundancy_image(sensors, rows, path)
    )
