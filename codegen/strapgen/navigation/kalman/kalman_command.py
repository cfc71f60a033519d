"""The command ``strapgen kalman`` derives a filter from its description, shows it and writes its code."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Needs, Shown, grouped, rules
from strapgen.cli.options import option
from strapgen.cli.output import Format, NewFolder, check_format, show
from strapgen.cli.progress import waiting
from strapgen.cli.values import names
from strapgen.ir.exceptions import InputError


@grouped
@rules(Needs("--project --check --force", "--out"))
def kalman(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="TOML file with states, measurements, noise and schedule.",
            show_default=False,
        ),
    ],
    *,
    target: Annotated[
        str,
        option(
            "--target",
            metavar="NAME",
            help="Kind of code; strapgen list targets shows all.",
            panel="Algorithm",
            read=names("strapgen.targets:TARGETS"),
        ),
    ] = "c",
    form: Annotated[
        str | None,
        option(
            "--form",
            metavar="NAME",
            help="Form of a covariance that is computed online, in place of that in the file: joseph or ud.",
            panel="Algorithm",
            read=names("strapgen.navigation.kalman:FORMS"),
        ),
    ] = None,
    fixed: Annotated[FixedOptions, Shown(only=("word", "rounding", "carry", "allowance", "formats"))],
    out: NewFolder = None,
    output: Annotated[SourceOptions, Shown(only=("project", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate a Kalman filter from its description.

    A file states the states with their differential equations, the measurements, the noise, and whether gains are
    steady, scheduled or computed online. You see the matrices, the observability, the gains and the costs. With --out
    you get a function for the time update, one for each measurement, and the table of a schedule.

    Example: strapgen kalman examples/kalman/gyrocompass.toml

    Example: strapgen kalman examples/kalman/gyrocompass.toml --target c-fixed --word 32 --out firmware
    """
    check_format(format)
    from strapgen.ir.fixed_settings import Settings
    from strapgen.navigation.kalman import gain_tables
    from strapgen.navigation.kalman.kalman_filter import kalman as read
    from strapgen.navigation.kalman.kalman_report import KalmanResult
    from strapgen.targets import TARGETS

    settings = fixed.settings(1)
    if TARGETS[target].fixed:
        settings = settings or Settings()
    elif settings is not None:
        raise InputError(f"the options of fixed point go with a target in fixed point, not with {target}")
    with waiting("deriving"):
        model = read(file, form)
        sources = model.sources(target, settings)
    place = replace(output, out=out)
    place.require_language(target)
    command = f"{model.text.command} --target {target}"
    if settings is not None:
        command += f" --word {settings.word} --rounding {settings.rounding}"
    code = {name: text for one in sources for name, text in one.step_files.items()}
    code |= gain_tables.files(model, sources[1:], target, command)
    function = replace(sources[0].function, name=model.text.name)
    whole = replace(sources[0], files=code, function=function, runs=())
    files = place.files(whole, "kalman.project", whole, model, sources, settings, command)
    if output.check:
        place.show_difference(files, format)
        return
    written = place.write(files) if out is not None else []
    show(KalmanResult.of(model, sources, target, written), format)
