"""The command ``strapgen strapdown`` runs an algorithm in two speeds, or a described system, along a recording."""

from __future__ import annotations

from collections.abc import Iterable
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
from strapgen.lab.run_options import RecordingOptions, SampleSource, SensorFile, inertial
from strapgen.navigation.systems.built_in import is_system

if TYPE_CHECKING:
    from strapgen.lab.motions.motions import Motion
    from strapgen.lab.recordings.recording import InertialRecording
    from strapgen.navigation.courses import Course, NavigationFrame


#: What three numbers are where nothing else is known
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
        Vector | None,
        option(
            "--initial-deg",
            metavar="R,P,H",
            help="Roll, pitch and heading at the start in deg.  [default: those of the motion; 0,0,0]",
        ),
    ] = None
    frame_rate: Annotated[
        Vector | None,
        option(
            "--frame-rate-deg-h",
            metavar="X,Y,Z",
            help="Rate of the navigation frame in deg/h, in navigation axes.  [default: that at the start of the "
            "motion; 0,0,0]",
        ),
    ] = None

    def matrix(self) -> Any:
        """Return the attitude at the start as a matrix, (3, 3)."""
        import numpy as np

        from strapgen.run.backends import evaluator

        return evaluator("dcm-from-euler-angles")(np.radians([*map(float, self.initial or _ZERO)]))

    def frame(self) -> NavigationFrame:
        """Return the navigation frame with the attitude at its start."""
        import numpy as np

        from strapgen.navigation.courses import NavigationFrame

        begin, rate = (np.radians([*map(float, three or _ZERO)]) for three in (self.initial, self.frame_rate))
        return NavigationFrame(begin, rate / 3600)

    def on(self, motion: Motion | None) -> Start:
        """Return the start on a motion: attitude and frame rate of one over the earth, where none is stated."""
        import numpy as np

        from strapgen.navigation.systems.system_flight import over_earth

        true = None if motion is None else over_earth(motion)
        if true is None:
            return self
        angles, _ = true.controls.angles(np.zeros(1))
        east, north, up = np.degrees(sum(true.frame_rates(0.0))) * 3600
        rate = float(north), float(east), -float(up)
        return Start(self.initial or _vector(np.degrees(np.ravel(angles))), self.frame_rate or _vector(rate))


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = (Number(repr(float(value))) for value in values)
    return x, y, z


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


#: The options of a recording of gyros and accelerometers, and of a motion.
_SOURCE = (
    *(one.name for one in fields(RecordingOptions) if one.name not in ("rates_csv", "resample_hz")),
    *("motion", "settings", "step", "duration"),
)


@grouped
@rules(
    OneOf(
        "--recording --increments-csv --motion", needed="one of --recording, --motion is needed; none given"
    )
)
def strapdown(
    algorithm: StrapdownAlgorithm,
    *,
    cycles: CycleCounts,
    backend: OneBackend = "numpy",
    source: Annotated[SampleSource, Shown(only=_SOURCE)],
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
    errors. In place of a recording it takes a motion over the earth, whose --step is that of the samples.

    A described system, a built-in one or a file, takes the rate of the recording, and you see its outputs at the rate
    of the slowest of them.

    Example: strapgen strapdown dcm --recording examples/inertial_log.csv --fast-cycles 4 --slow-cycles 25
    --backend c
    """
    output.check(*source.files, errors)
    data, motion = _measured(source, errors)
    start = start.on(motion)
    if is_system(algorithm):
        from strapgen.navigation.systems.system_simulation import system_along

        return system_along(
            algorithm, stated(cycles), backend, source, (data, motion), errors, start, fixed, output
        )
    counts = cycles.counts()
    fixed.check_backend(backend)
    covered = _course(algorithm, data, counts, backend, fixed, start)
    of_cycle = counts["fast_cycles"] * counts["slow_cycles"]
    if motion is None:
        source.say_remarks(data)
    if output.file is not None or output.format not in (None, "text"):  # the text says it itself
        say_unused(_named(source), covered.unused, of_cycle, "navigation cycle")
    facts = {"algorithm": f"{algorithm} in two speeds", "backend": backend, **_facts(source)}
    facts |= {} if errors is None else {"errors": errors}
    _deliver(covered, facts, f"{facts['algorithm']}, {backend}: {_named(source).name}", output)


def _named(source: SampleSource) -> Path:
    """Return the file of a source, or the name of its motion."""
    return source.file if source.motion is None else Path(source.motion)


def _facts(source: SampleSource) -> dict[str, str]:
    """Return where increments come from, for the head of a result."""
    if source.motion is None:
        return {"source": source.source}
    return {"motion": source.described(source.motion), "duration_s": f"{float(source.duration or 0):g}"}


def _measured(source: SampleSource, errors: str | None) -> tuple[InertialRecording, Motion | None]:
    """Return the increments of a recording, or of a motion over the earth and that."""
    if source.motion is None:
        return inertial(source, errors), None
    from strapgen.ir import checks
    from strapgen.lab.recordings.recording import InertialRecording
    from strapgen.lab.run_options import read_errors, with_errors
    from strapgen.navigation.vehicle.vehicle_motions import named

    if source.step is None or source.duration is None:
        missing = "--step" if source.step is None else "--duration"
        raise InputError(f"--motion needs {missing} in s")
    motion = named(source.motion, source.settings or {})
    count = checks.multiple("duration", source.duration, "step", source.step)
    angle, velocity = motion.both_samples(source.step, 0, count)
    recording = InertialRecording(0.0, float(source.step), angle, velocity)
    return with_errors(recording, read_errors(errors)), motion


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
