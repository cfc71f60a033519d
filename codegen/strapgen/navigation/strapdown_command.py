"""The command ``strapgen strapdown`` runs an algorithm in two speeds, or a described system, along a recording."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import OneOf, Shown, grouped, rules, stated
from strapgen.cli.options import OneBackend, StrapdownAlgorithm, option
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.cli.progress import say_unused
from strapgen.cli.values import Number, Vector
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import RecordingOptions, SensorFile, inertial
from strapgen.navigation.systems.built_in import is_system

if TYPE_CHECKING:
    from strapgen.lab.recordings.recording import InertialRecording
    from strapgen.navigation.courses import Course, NavigationFrame


#: The default of three numbers
_ZERO = (Number("0"), Number("0"), Number("0"))


@dataclass(frozen=True)
class CourseOutput(Output):
    """Options for the output of attitude and velocity changes along a recording."""

    plot: Annotated[Path | None, plot_option("the attitude and the velocity changes")] = None
    format: Annotated[str | None, format_option(Output.formats, "  [default: text; csv with --out]")] = None


@dataclass(frozen=True)
class Start:
    """Options of the attitude at the start, and of the rate of the navigation frame."""

    panel: ClassVar[str] = "Input"

    initial: Annotated[
        Vector, option("--initial-deg", metavar="R,P,H", help="Roll, pitch and heading at the start in deg.")
    ] = _ZERO
    frame_rate: Annotated[
        Vector,
        option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, in navigation axes.",
        ),
    ] = _ZERO

    def matrix(self) -> Any:
        """Return the attitude at the start as a matrix, (3, 3)."""
        import numpy as np

        from strapgen.run.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians([*map(float, self.initial)]))

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.navigation.courses import NavigationFrame

        begin, rate = (np.radians([*map(float, three)]) for three in (self.initial, self.frame_rate))
        return NavigationFrame(begin, rate / 3600)


@dataclass(frozen=True)
class CycleCounts:
    """Options of an algorithm in two speeds: the cycles of its loops, and its sculling integral."""

    panel: ClassVar[str] = "Algorithm"

    fast: Annotated[
        int | None,
        option("--fast-cycles", metavar="N", help="Number of fast cycles in a slow cycle."),
    ] = None
    slow: Annotated[
        int | None,
        option(
            "--slow-cycles", metavar="N", help="Number of slow cycles in a navigation cycle.  [default: 1]"
        ),
    ] = None
    sculling: Annotated[
        int | None,
        option(
            "--sculling",
            metavar="N",
            help="Form of the sculling integral: 1 with the rotation compensation, 2 without.  [default: 2]",
        ),
    ] = None

    def counts(self) -> dict[str, int]:
        """Return the cycles and the form of the sculling integral."""
        if self.fast is None:
            raise InputError("--fast-cycles is missing; an algorithm in two speeds needs it")
        return {
            "fast_cycles": self.fast,
            "slow_cycles": 1 if self.slow is None else self.slow,
            "sculling": 2 if self.sculling is None else self.sculling,
        }


#: The options of a recording of gyros and accelerometers.
_RECORDING = tuple(
    one.name for one in fields(RecordingOptions) if one.name not in ("rates_csv", "resample_hz")
)


@grouped
@rules(OneOf("--recording --increments-csv", needed="--recording is needed; none given"))
def strapdown(
    algorithm: StrapdownAlgorithm,
    *,
    cycles: CycleCounts,
    backend: OneBackend = "numpy",
    source: Annotated[RecordingOptions, Shown(only=_RECORDING)],
    errors: SensorFile = None,
    start: Start,
    fixed: Annotated[FixedOptions, Shown(only=("word", "rounding", "carry", "ranges", "formats"))],
    output: CourseOutput,
) -> None:
    """Run an algorithm in two speeds along an inertial recording.

    The recording has increments of fast cycles, angles in rad and velocities in m/s, or rates and specific forces.

    A fast loop sums coning and sculling; a slow loop updates the attitude once in a number of fast cycles. After every
    navigation cycle you see the attitude as roll, pitch and heading, and the integral of the specific force over the
    cycle in navigation axes. Fixed-point formats are chosen for the recording.

    With --errors the increments of the recording are taken as true, and the algorithm gets those of sensors with
    errors.

    A described system, a built-in one or a file, takes the rate of the recording, and you see its outputs at the rate
    of the slowest of them.

    Example: strapgen strapdown dcm --recording examples/inertial_log.csv --fast-cycles 4 --slow-cycles 25
    --backend c
    """
    output.check(source.file, errors)
    if is_system(algorithm):
        from strapgen.navigation.systems.system_simulation import system_along

        return system_along(algorithm, stated(cycles), backend, source, errors, start, fixed, output)
    counts = cycles.counts()
    fixed.check_backend(backend)
    data = inertial(source, errors)
    covered = _course(algorithm, data, counts, backend, fixed, start)
    of_cycle = counts["fast_cycles"] * counts["slow_cycles"]
    source.say_remarks(data)
    if output.file is not None or output.format not in (None, "text"):  # the text says it itself
        say_unused(source.file, covered.unused, of_cycle, "navigation cycle")
    facts = {"algorithm": f"{algorithm} in two speeds", "backend": backend, "source": source.source}
    facts |= {} if errors is None else {"errors": errors}
    _deliver(covered, facts, f"{facts['algorithm']}, {backend}: {source.file.name}", output)


def _course(
    algorithm: str,
    data: InertialRecording,
    counts: dict[str, int],
    backend: str,
    fixed: FixedOptions,
    start: Start,
) -> Course:
    """Run the algorithm along a recording."""
    import numpy as np

    from strapgen.navigation.courses import course

    settings = fixed.settings_for_run(backend, 1, data.interval, lambda: data.largest)
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        return course(algorithm, data, **counts, backend=backend, settings=settings, frame=start.frame())


def _deliver(covered: Course, facts: dict[str, str], title: str, output: CourseOutput) -> None:
    from strapgen.navigation.courses import CourseResult

    format = output.format or ("text" if output.file is None else "csv")
    replace(output, format=format).show(CourseResult(facts, covered, title))
