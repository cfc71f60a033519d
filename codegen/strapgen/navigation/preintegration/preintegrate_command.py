"""The command ``strapgen preintegrate``: a C++ header that preintegrates stamped samples."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import option
from strapgen.cli.output import Format, check_format, show
from strapgen.cli.progress import waiting
from strapgen.cli.values import names
from strapgen.navigation.preintegration import INPUTS


@grouped
def preintegrate(
    *,
    window: Annotated[
        str,
        option(
            "--window",
            metavar="NAME|FILE",
            help="A window as pair-1-8, or a TOML file with one, as for a sensor's response, or kept-sample.",
            panel="Samples",
        ),
    ] = "pair-1-8",
    input: Annotated[
        str,
        option(
            "--input",
            metavar="NAME",
            help="What the samples are: increments since the stamp before; rates, their means; or instants, rates at "
            "the stamps.",
            panel="Samples",
            read=names(INPUTS),
        ),
    ] = "increments",
    target: Annotated[
        str,
        option("--target", metavar="NAME", help="Kind of code: cpp.", panel="Samples", read=names(("cpp",))),
    ] = "cpp",
    output: Annotated[SourceOptions, Shown(only=("out", "name", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate a C++ header that preintegrates stamped samples.

    It sums them up between any two instants: rotation, velocity and position, with their covariance and bias Jacobian,
    for the factors of an estimator.

    Example: strapgen preintegrate --window pair-1-8 --target cpp --out imu

    Example: strapgen preintegrate --window pair-1-5 --input rates --name imu --out imu
    """
    check_format(format)
    from strapgen.navigation.preintegration import preintegration_sources

    with waiting("generating"):
        sources = preintegration_sources.sources(window, input, target, output.name)
    files = sources.step_files
    if output.check:
        output.show_difference(files, format)
        return
    written = output.write(files)
    kernel, operations = sources.kernel, sources.operations
    show(
        preintegration_sources.PreintegrationResult(sources.function.name, kernel, written, operations),
        format,
    )
