"""The command ``strapgen two-speed`` writes the C code of an algorithm in two speeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Sculling, TwoSpeedAlgorithm, option, whole
from strapgen.cli.output import Format, check_format, print_json
from strapgen.cli.source_options import SourceOptions
from strapgen.support.exceptions import InputError


@grouped
def two_speed(
    algorithm: TwoSpeedAlgorithm,
    *,
    sculling: Sculling = "2",
    target: Annotated[
        str,
        option("--target", metavar="NAME", help="Kind of code: c, c-float or c-fixed.", panel="Algorithm"),
    ] = "c",
    fixed: Annotated[
        FixedOptions,
        Shown(only=("word", "rounding", "carry", "drift_allowance", "ranges", "formats")),
    ],
    output: Annotated[SourceOptions, Shown(only=("out", "with_runs", "project", "force"))],
    format: Format = "text",
) -> None:
    """Generate the C code of an algorithm in two speeds.

    You get a function for each loop, and one that runs them all.

    Example: strapgen two-speed dcm --target c --out firmware
    """
    check_format(format)
    from strapgen.ir.fixed_settings import Settings
    from strapgen.systems import two_speed_sources
    from strapgen.targets import fixed_targets

    form = whole("sculling", sculling) or 0
    settings = fixed.settings(1)
    if target in fixed_targets():
        settings = settings or Settings()
    elif settings is not None:
        raise InputError(f"the options of fixed point go with --target c-fixed, not with {target}")
    sources = two_speed_sources.sources(algorithm, form, target, settings)
    files = sources.files if output.with_runs else sources.step_files
    if output.project:
        from strapgen.experiments import project, two_speed_project

        added = two_speed_project.project_files(algorithm, form, target, settings)
        project.refuse_changed(output.out or Path(), added, output.force)
        files = files | added
    written = output.write(files)
    if format == "json":
        print_json(
            {
                "kernel": sources.kernel,
                "target": target,
                "loops": list(two_speed_sources.kernels(algorithm, form)),
                "files": [str(path) for path in written],
                "operations": sources.operations,
            }
        )
        return
    typer.echo(f"{sources.kernel} for {target}")
    for path in written:
        typer.echo(f"  {path}")
