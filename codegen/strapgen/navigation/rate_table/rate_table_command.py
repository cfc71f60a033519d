"""The command ``strapgen rate-table`` runs the rate-table test."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Duration, FastBackends, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import Positive


@grouped
def rate_table(
    *,
    algorithm: Annotated[
        tuple[str, ...] | None,
        option(
            "--algorithm",
            "--algorithms",
            metavar="NAME,...",
            help="Algorithms, with commas between: dcm, euler, cayley-klein, two-speed.  [default: all]",
            panel="Algorithm",
        ),
    ] = None,
    method: Annotated[
        tuple[str, ...] | None,
        option(
            "--method",
            metavar="NAME,...",
            help="Methods of the attitude steps, with commas between; strapgen list methods shows all.  [default: six]",
            panel="Algorithm",
        ),
    ] = None,
    backend: FastBackends = None,
    duration: Duration = Positive("3600"),
    sample: Annotated[
        Positive, option("--sample", metavar="S", help="Time between gyro samples in s.", panel="Input")
    ] = Positive("0.01"),
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
    from strapgen.navigation.rate_table.rate_table_plot import rate_table_image
    from strapgen.navigation.rate_table.rate_table_report import rate_table_report

    names, places = algorithm or experiment.ALGORITHMS, backend or experiment.DEFAULT_BACKENDS
    count = len(list(experiment.cases(names, places, method)))
    runs = experiment.stress(duration, sample, 1, places, names, fixed.settings(1), method)
    rows, times = list(track(runs, "running", count)), (str(duration), str(sample))
    output.report(rate_table_report(rows, *times), lambda path: rate_table_image(rows, *times, path))
