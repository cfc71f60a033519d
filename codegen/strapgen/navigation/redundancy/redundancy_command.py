"""The command ``strapgen redundancy`` analyses redundant sensors on any axes, and writes their code."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Needs, Shown, grouped, rules
from strapgen.cli.options import option
from strapgen.cli.output import Format, NewFolder, check_format, show
from strapgen.cli.progress import track, waiting
from strapgen.cli.values import names

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings
    from strapgen.navigation.redundancy.redundancy_kernels import SensorSet


@grouped
@rules(Needs("--check --force", "--out"))
def redundancy(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="TOML file with axes = [[1, 0, 0], ...], a row a sensor.", show_default=False
        ),
    ],
    *,
    target: Annotated[
        str,
        option(
            "--target",
            metavar="NAME",
            help="Kind of code: c, c-float, c-fixed, numpy or fixed-model.",
            panel="Algorithm",
            read=names("strapgen.targets:BUILT_IN"),
        ),
    ] = "c",
    fixed: Annotated[FixedOptions, Shown(only=("word", "rounding", "carry"))],
    out: NewFolder = None,
    output: Annotated[SourceOptions, Shown(only=("check", "force"))],
    format: Format = "text",
) -> None:
    """Derive parity equations and failure isolation for sensors.

    Components of an axis are exact: whole numbers, decimals, or texts such as "2/3" and "sqrt(3)/2". You see the
    parity equations, the noise of every triad, and how many failures are isolated. With --out you get the code of all:
    parity, selection, triads, and the tables as CSV.

    Example: strapgen redundancy examples/hexad.toml --target c-fixed --out out/hexad
    """
    check_format(format)
    from strapgen.navigation.redundancy.geometry_report import GeometryResult, failure_tables, tables_csv
    from strapgen.navigation.redundancy.redundancy_kernels import read

    settings = fixed.settings(1)
    sensors = read(file)
    with waiting("scanning the parity space"):
        tables = failure_tables(sensors.geometry)
    written: list[Path] = []
    if out is not None:
        files = _sources(sensors, target, settings)
        files[f"{sensors.name}_tables.csv"] = tables_csv(sensors, tables)
        output = replace(output, out=out)
        if output.check:
            output.show_difference(files, format)
            return
        written = output.write(files)
    show(GeometryResult.of(sensors, tables, written), format)


def _sources(sensors: SensorSet, target: str, settings: Settings | None) -> dict[str, str]:
    """Return the files of all kernels of a set of sensors."""
    from strapgen import pipeline
    from strapgen.navigation.redundancy.redundancy_kernels import kernels
    from strapgen.run.kernel_sources import sources_of_program

    files: dict[str, str] = {}
    for kernel in track(kernels(sensors), "generating", 4 + len(sensors.geometry.triads)):
        files |= sources_of_program(pipeline.lower(kernel), target, settings).step_files
    return files
