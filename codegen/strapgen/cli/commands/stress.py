"""strapgen stress."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen.cli.fixed_options import Carry, Rounding, read_settings
from strapgen.cli.options import Format, check_format, print_json
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError


def stress(
    algorithms: Annotated[
        str | None,
        typer.Option(
            "--algorithms",
            metavar="NAME,...",
            help="dcm, euler, cayley-klein, two-speed.  [default: all]",
            show_default=False,
        ),
    ] = None,
    backends: Annotated[
        str | None,
        typer.Option(
            "--backends",
            metavar="NAME,...",
            help="Back ends.  [default: all but the slow ones, fixed-model and exact]",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[str, typer.Option("--duration", metavar="S", help="Duration in s.")] = "3600",
    sample: Annotated[
        str, typer.Option("--sample", metavar="S", help="Time from gyro sample to sample in s.")
    ] = "0.01",
    rounding: Rounding = None,
    carry: Carry = None,
    format: Format = "text",
) -> None:
    """Turn every algorithm on every back end at 70 deg/s about all three axes, steadily and to and fro.

    The rate-table test of 1984: the pitch passes 90 deg again and again. Printed is the largest drift of the run; steps
    are orthonormalized every second.

    Example: strapgen stress --duration 20 --algorithms euler,two-speed --backends numpy,c
    """
    check_format(format)
    from strapgen.experiments import rate_table as test
    from strapgen.reports.rate_table import rate_table_text

    def names(option: str, value: str | None, default: tuple[str, ...]) -> tuple[str, ...]:
        if value is None:
            return default
        found = tuple(dict.fromkeys(name.strip() for name in value.split(",") if name.strip()))
        if not found:
            raise InputError(f"--{option} is {value!r}; at least one name is needed")
        return found

    chosen = names("algorithms", algorithms, test.ALGORITHMS)
    places = names("backends", backends, test.DEFAULT_BACKENDS)
    count = len(list(test.cases(chosen, places)))
    settings = read_settings(1, rounding=rounding, carry=carry)
    runs = test.stress(duration, sample, 1, places, chosen, settings)
    rows = list(track(runs, "running", count))
    if format == "json":
        print_json([row.as_dict() for row in rows])
    else:
        typer.echo(rate_table_text(rows, duration, sample))
