"""The command ``strapgen window generate`` writes C that commits an attitude late and answers it now."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.option_groups import Needs, Shown, grouped, rules
from strapgen.cli.options import CTarget, option
from strapgen.cli.output import Format, check_format, show
from strapgen.cli.program import PlainCommand
from strapgen.cli.progress import waiting
from strapgen.cli.values import Positive
from strapgen.design.windows.window_argument import WindowArgument, window_of
from strapgen.design.windows.window_command import app

if TYPE_CHECKING:
    from strapgen.ir.sources import Sources

__all__ = ["app", "generate"]


@app.command("generate", cls=PlainCommand)
@grouped
@rules(Needs("--max-rate-deg-s --lsb", "--sample-hz"))
def generate(
    window: WindowArgument,
    *,
    algorithm: Annotated[
        str,
        option("--algorithm", metavar="NAME", help="Attitude: euler or dcm.", panel="Algorithm"),
    ] = "euler",
    target: CTarget = "c",
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz",
            metavar="HZ",
            help="Samples of the gyro in a second: filters for a gyro need it, --max-rate-deg-s and --lsb do.",
            panel="Algorithm",
        ),
    ] = None,
    fixed: Annotated[
        FixedOptions,
        Shown(
            only=(
                *("word", "max_rate_deg_s", "largest_angle", "lsb", "lsb_rad"),
                *("rounding", "carry", "allowance"),
            )
        ),
    ],
    output: Annotated[SourceOptions, Shown(only=("out", "name", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate C that commits an attitude late and answers it now.

    Each sample is passed to a function, which commits the attitude a few samples late, by filters on both sides of it;
    another function answers the attitude of now. A lost sample is restored.

    Example: strapgen window generate window-7-7 --target c --out out/late
    """
    check_format(format)
    sources = generated(window, algorithm, target, sample_hz, fixed, output.name)
    files = sources.step_files
    if output.check:
        difference = output.compare(files)
        typer.echo(difference, nl=False)
        raise typer.Exit(1 if difference else 0)
    written = output.write(files)
    from strapgen.design.commit_late.commit_late_sources import LateResult

    show(LateResult(sources.function.name, target, written, sources.operations), format)


def generated(
    window: str,
    algorithm: str,
    target: str,
    sample_hz: Positive | None,
    fixed: FixedOptions,
    name: str | None,
) -> Sources:
    """Return the sources that the options ask for."""
    from strapgen.design.commit_late import commit_late_sources

    rated = sample_hz if (fixed.max_rate_deg_s, fixed.lsb) != (None, None) else None
    settings = replace(fixed, sample_hz=rated).settings(1)
    with waiting("generating"):
        return commit_late_sources.sources(window_of(window), algorithm, target, sample_hz, name, settings)
