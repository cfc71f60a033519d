"""The command ``strapgen strapdown`` runs an algorithm in two speeds along a recording."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import whole
from strapgen.cli.output import Output
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.simulation.courses import NavigationFrame


@dataclass(frozen=True)
class CourseOutput(Output):
    """Where the attitude and the velocity changes along a recording go."""

    format: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="Format of the output: text, json or csv.  [default: text; csv with --out]",
            show_default=False,
        ),
    ] = None


@dataclass(frozen=True)
class Start:
    """Options of the attitude at the start, and of the rate of the navigation frame."""

    initial: Annotated[
        str,
        typer.Option("--initial-deg", metavar="R,P,H", help="Roll, pitch and heading at the start in deg."),
    ] = "0,0,0"
    frame_rate: Annotated[
        str,
        typer.Option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, in navigation axes.",
        ),
    ] = "0,0,0"

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.simulation.courses import NavigationFrame

        begin = np.radians(_three("initial-deg", self.initial))
        return NavigationFrame(begin, np.radians(_three("frame-rate-deg-h", self.frame_rate)) / 3600)


@grouped
def strapdown(
    algorithm: Annotated[str, typer.Argument(help="dcm or euler.")],
    *,
    increments: Annotated[
        Path,
        typer.Option(
            "--increments-csv",
            metavar="FILE",
            help="CSV file of fast cycles' increments: columns t in s, dx, dy, dz in rad, and dvx, dvy, dvz in m/s.",
        ),
    ],
    fast_cycles: Annotated[
        str, typer.Option("--fast-cycles", metavar="N", help="Number of fast cycles in a slow cycle.")
    ],
    slow_cycles: Annotated[
        str, typer.Option("--slow-cycles", metavar="N", help="Number of slow cycles in a navigation cycle.")
    ] = "1",
    sculling: Annotated[
        str,
        typer.Option(
            "--sculling",
            help="Form of the sculling integral: 1 with the rotation compensation, 2 without.",
        ),
    ] = "2",
    backend: Annotated[
        str,
        typer.Option("--backend", help="Back end: numpy, c, c-float, c-q31, c-q15, fixed-model or exact."),
    ] = "numpy",
    start: Start,
    fixed: Annotated[FixedOptions, Shown(only=("word", "rounding", "carry", "ranges", "formats"))],
    output: Annotated[CourseOutput, Shown(only=("out", "format"))],
) -> None:
    """Run an algorithm in two speeds along recorded gyro and accelerometer increments.

    A fast loop sums coning and sculling; a slow loop updates the attitude once in a number of fast cycles. After every
    navigation cycle you see the attitude as roll, pitch and heading, and the integral of the specific force over the
    cycle in navigation axes. Fixed-point formats are chosen for the recording.

    Example:

    \b
      strapgen strapdown dcm --increments-csv examples/inertial_log.csv \\
        --fast-cycles 4 --slow-cycles 25 --backend c
    """  # noqa: D301
    output.check(increments)
    import numpy as np

    from strapgen.reports import runs
    from strapgen.simulation import recording
    from strapgen.simulation.courses import course

    fixed.check_backend(backend)
    data = recording.read_inertial(increments)
    settings = fixed.settings_for_run(backend, 1, data.interval, lambda: data.largest)
    frame = start.frame()
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        covered = course(
            algorithm,
            data,
            fast_cycles=whole("fast-cycles", fast_cycles) or 0,
            slow_cycles=whole("slow-cycles", slow_cycles) or 0,
            sculling=whole("sculling", sculling) or 0,
            backend=backend,
            settings=settings,
            frame=frame,
        )
    facts = {
        "algorithm": f"{algorithm} in two speeds",
        "backend": backend,
        "source": str(increments),
    }
    format = output.format or ("text" if output.out is None else "csv")
    if format == "csv":
        output.deliver(runs.course_csv(covered))
    elif format == "json":
        output.deliver(json.dumps(runs.course_data(covered, facts)))
    else:
        output.deliver(runs.course_text(covered, facts))


def _three(name: str, text: str) -> list[float]:
    from strapgen.support import checks

    parts = text.split(",")
    if len(parts) != 3:
        raise InputError(f"--{name} is {text!r}; three numbers with commas between are needed")
    return [float(checks.number(name, part)) for part in parts]
