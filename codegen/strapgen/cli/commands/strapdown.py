"""The command ``strapgen strapdown`` runs an algorithm in two speeds along a recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import OneBackend, Sculling, TwoSpeedAlgorithm, option, whole
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.simulation.courses import NavigationFrame


@dataclass(frozen=True)
class CourseOutput(Output):
    """Where the attitude and the velocity changes along a recording go."""

    plot: Annotated[Path | None, plot_option("the attitude and the velocity changes")] = None
    format: Annotated[str | None, format_option(Output.formats, "  [default: text; csv with --out]")] = None


@dataclass(frozen=True)
class Start:
    """Options of the attitude at the start, and of the rate of the navigation frame."""

    panel: ClassVar[str] = "Input"

    initial: Annotated[
        str, option("--initial-deg", metavar="R,P,H", help="Roll, pitch and heading at the start in deg.")
    ] = "0,0,0"
    frame_rate: Annotated[
        str,
        option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, in navigation axes.",
        ),
    ] = "0,0,0"

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.simulation.courses import NavigationFrame

        begin = np.radians(_three("--initial-deg", self.initial))
        return NavigationFrame(begin, np.radians(_three("--frame-rate-deg-h", self.frame_rate)) / 3600)


@grouped
def strapdown(
    algorithm: TwoSpeedAlgorithm,
    *,
    fast_cycles: Annotated[
        str,
        option(
            "--fast-cycles", metavar="N", help="Number of fast cycles in a slow cycle.", panel="Algorithm"
        ),
    ],
    slow_cycles: Annotated[
        str,
        option(
            "--slow-cycles",
            metavar="N",
            help="Number of slow cycles in a navigation cycle.",
            panel="Algorithm",
        ),
    ] = "1",
    sculling: Sculling = "2",
    backend: OneBackend = "numpy",
    increments: Annotated[
        Path,
        option(
            "--increments-csv",
            metavar="FILE",
            help="CSV file of fast cycles' increments: columns t in s, dx, dy, dz in rad, and dvx, dvy, dvz in m/s.",
            panel="Input",
        ),
    ],
    start: Start,
    fixed: Annotated[FixedOptions, Shown(only=("word", "rounding", "carry", "ranges", "formats"))],
    output: CourseOutput,
) -> None:
    """Run an algorithm in two speeds along an inertial recording.

    A fast loop sums coning and sculling; a slow loop updates the attitude once in a number of fast cycles. After every
    navigation cycle you see the attitude as roll, pitch and heading, and the integral of the specific force over the
    cycle in navigation axes. Fixed-point formats are chosen for the recording.

    Example: strapgen strapdown dcm --increments-csv examples/inertial_log.csv --fast-cycles 4 --slow-cycles 25
    --backend c
    """
    output.check(increments)
    import numpy as np

    from strapgen.reports import plots, runs
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
            fast_cycles=whole("fast_cycles", fast_cycles) or 0,
            slow_cycles=whole("slow_cycles", slow_cycles) or 0,
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
    format = output.format or ("text" if output.file is None else "csv")
    title = f"{facts['algorithm']}, {backend}: {increments.name}"
    replace(output, format=format).report(
        runs.course_report(covered, facts), lambda path: plots.course_image(covered, title, path)
    )


def _three(name: str, text: str) -> list[float]:
    from strapgen.support import checks

    parts = text.split(",")
    if len(parts) != 3:
        raise InputError(f"{name} is {text!r}; three numbers with commas between are needed")
    return [float(checks.number(name, part)) for part in parts]
