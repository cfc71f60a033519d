"""The command ``strapgen strapdown`` runs an algorithm in two speeds along a recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import OneBackend, StrapdownAlgorithm, option, whole
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.support.exceptions import InputError
from strapgen.systems.built_in import is_system

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

    def matrix(self) -> Any:
        """Return the attitude at the start as a matrix, (3, 3)."""
        import numpy as np

        from strapgen.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians(_three("--initial-deg", self.initial)))

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.simulation.courses import NavigationFrame

        begin = np.radians(_three("--initial-deg", self.initial))
        return NavigationFrame(begin, np.radians(_three("--frame-rate-deg-h", self.frame_rate)) / 3600)


@dataclass(frozen=True)
class CycleCounts:
    """Options of an algorithm in two speeds: the cycles of its loops, and its sculling integral."""

    panel: ClassVar[str] = "Algorithm"

    fast: Annotated[
        str | None,
        option("--fast-cycles", metavar="N", help="Number of fast cycles in a slow cycle."),
    ] = None
    slow: Annotated[
        str | None,
        option(
            "--slow-cycles", metavar="N", help="Number of slow cycles in a navigation cycle.  [default: 1]"
        ),
    ] = None
    sculling: Annotated[
        str | None,
        option(
            "--sculling",
            metavar="N",
            help="Form of the sculling integral: 1 with the rotation compensation, 2 without.  [default: 2]",
        ),
    ] = None

    @property
    def stated(self) -> list[str]:
        """The options that the command line has."""
        values = {"--fast-cycles": self.fast, "--slow-cycles": self.slow, "--sculling": self.sculling}
        return [name for name, value in values.items() if value is not None]

    def counts(self) -> dict[str, int]:
        """Return the cycles and the form of the sculling integral."""
        if self.fast is None:
            raise InputError("--fast-cycles is missing; an algorithm in two speeds needs it")
        return {
            "fast_cycles": whole("fast_cycles", self.fast) or 0,
            "slow_cycles": whole("slow_cycles", self.slow or "1") or 0,
            "sculling": whole("sculling", self.sculling or "2") or 0,
        }


@grouped
def strapdown(
    algorithm: StrapdownAlgorithm,
    *,
    cycles: CycleCounts,
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

    A described system, a built-in one or a file, takes the rate of the recording, and you see its outputs at the rate
    of the slowest of them.

    Example: strapgen strapdown dcm --increments-csv examples/inertial_log.csv --fast-cycles 4 --slow-cycles 25
    --backend c
    """
    output.check(increments)
    if is_system(algorithm):
        from strapgen.cli.systems.along import system_along

        return system_along(algorithm, cycles.stated, backend, increments, start, fixed, output)
    counts = cycles.counts()
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
            **counts,
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
