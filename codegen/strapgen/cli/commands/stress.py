"""The command ``strapgen stress`` runs the rate-table test."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import listed
from strapgen.cli.output import Format, check_format, print_json
from strapgen.cli.progress import track


@grouped
def stress(
    *,
    algorithms: Annotated[
        str | None,
        typer.Option(
            "--algorithms",
            metavar="NAME,...",
            help="Algorithms to run: dcm, euler, cayley-klein, two-speed.  [default: all]",
            show_default=False,
        ),
    ] = None,
    backends: Annotated[
        str | None,
        typer.Option(
            "--backends",
            metavar="NAME,...",
            help="Back ends to run them on.  [default: all but fixed-model and exact, which are slow]",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[
        str, typer.Option("--duration", metavar="S", help="Duration of each run in s.")
    ] = "3600",
    sample: Annotated[
        str, typer.Option("--sample", metavar="S", help="Time between gyro samples in s.")
    ] = "0.01",
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry"))],
    format: Format = "text",
) -> None:
    """Run every algorithm on every back end at 70 deg/s about all three axes, in one direction and oscillating.

    This is the rate-table test of 1984, in which the pitch passes through 90 deg again and again. You see the largest
    drift of every run. Attitude steps are orthonormalized every second; algorithms in two speeds are not.

    Example: strapgen stress --duration 20 --algorithms euler,two-speed --backends numpy,c
    """
    check_format(format)
    from strapgen.experiments import rate_table
    from strapgen.reports.rate_table import rate_table_text

    names = _names("--algorithms", algorithms, rate_table.ALGORITHMS)
    places = _names("--backends", backends, rate_table.DEFAULT_BACKENDS)
    count = len(list(rate_table.cases(names, places)))
    runs = rate_table.stress(duration, sample, 1, places, names, fixed.settings(1))
    rows = list(track(runs, "running", count))
    if format == "json":
        print_json([row.as_dict() for row in rows])
    else:
        typer.echo(rate_table_text(rows, duration, sample))


def _names(option: str, text: str | None, default: tuple[str, ...]) -> tuple[str, ...]:
    return (
        default if text is None else tuple(listed(option, text, f"is {text!r}; at least one name is needed"))
    )
