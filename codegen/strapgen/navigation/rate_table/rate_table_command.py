"""The command ``strapgen rate-table`` runs the rate-table test."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Duration, FastBackends, backends, listed, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track


@grouped
def rate_table(
    *,
    algorithm: Annotated[
        str | None,
        option(
            "--algorithm",
            "--algorithms",
            metavar="NAME,...",
            help="Algorithms, with commas between: dcm, euler, cayley-klein, two-speed.  [default: all]",
            panel="Algorithm",
        ),
    ] = None,
    method: Annotated[
        str | None,
        option(
            "--method",
            metavar="NAME,...",
            help="Methods of the attitude steps, with commas between; strapgen list methods shows all.  [default: six]",
            panel="Algorithm",
        ),
    ] = None,
    backend: FastBackends = None,
    duration: Duration = "3600",
    sample: Annotated[
        str, option("--sample", metavar="S", help="Time between gyro samples in s.", panel="Input")
    ] = "0.01",
    fixed: Annotated[FixedOptions, Shown(only=("rounding", "carry"))],
    output: Output,
) -> None:
    """Run the rate-table test of 1984 on every algorithm and back end.

    The table turns at 70 deg/s about all three axes, in one direction and oscillating, so that the pitch passes through
    90 deg again and again. You see the largest drift of every run. Attitude steps are orthonormalized every second;
    algorithms in two speeds are not.

    Example: strapgen rate-table --duration 20 --algorithm euler,two-speed --backend numpy,c
    """
    output.check()
    from strapgen.navigation.rate_table import rate_table as experiment
    from strapgen.navigation.rate_table.rate_table_report import RateTableResult

    names = experiment.ALGORITHMS if algorithm is None else listed("--algorithm", algorithm)
    places = backends("--backend", backend, experiment.DEFAULT_BACKENDS)
    methods = None if method is None else listed("--method", method)
    count = len(list(experiment.cases(names, places, methods)))
    runs = experiment.stress(duration, sample, 1, places, names, fixed.settings(1), methods)
    rows = list(track(runs, "running", count))
    output.show(RateTableResult(rows, duration, sample))
