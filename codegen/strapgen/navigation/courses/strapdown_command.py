"""The command ``strapgen strapdown`` runs an algorithm in two speeds along a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped, stated
from strapgen.cli.options import OneBackend, StrapdownAlgorithm, option
from strapgen.cli.progress import say_unused
from strapgen.lab.run_options import SensorFile, read_errors, with_errors
from strapgen.navigation.courses.course_options import CourseOutput, CycleCounts, Start
from strapgen.navigation.systems.built_in import is_system

if TYPE_CHECKING:
    from strapgen.lab.recordings.recording import InertialRecording
    from strapgen.navigation.courses.courses import Course


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
    errors: SensorFile = None,
    start: Start,
    fixed: Annotated[FixedOptions, Shown(only=("word", "rounding", "carry", "ranges", "formats"))],
    output: CourseOutput,
) -> None:
    """Run an algorithm in two speeds along an inertial recording.

    A fast loop sums coning and sculling; a slow loop updates the attitude once in a number of fast cycles. After every
    navigation cycle you see the attitude as roll, pitch and heading, and the integral of the specific force over the
    cycle in navigation axes. Fixed-point formats are chosen for the recording.

    With --errors the increments of the file are the true ones, and the algorithm takes what sensors measure of them.

    A described system, a built-in one or a file, takes the rate of the recording, and you see its outputs at the rate
    of the slowest of them.

    Example: strapgen strapdown dcm --increments-csv examples/inertial_log.csv --fast-cycles 4 --slow-cycles 25
    --backend c
    """
    output.check(increments, errors)
    if is_system(algorithm):
        from strapgen.navigation.systems.strapdown_system import system_along

        return system_along(algorithm, stated(cycles), backend, (increments, errors), start, fixed, output)
    counts = cycles.counts()
    fixed.check_backend(backend)
    from strapgen.lab.recordings import recording

    data = with_errors(recording.read_inertial(increments), read_errors(errors))
    covered = _course(algorithm, data, counts, backend, fixed, start)
    of_cycle = counts["fast_cycles"] * counts["slow_cycles"]
    say_unused(increments, covered.unused, of_cycle, "navigation cycle")
    facts = {"algorithm": f"{algorithm} in two speeds", "backend": backend, "source": str(increments)}
    facts |= {} if errors is None else {"errors": errors}
    _deliver(covered, facts, f"{facts['algorithm']}, {backend}: {increments.name}", output)


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

    from strapgen.navigation.courses.courses import course

    settings = fixed.settings_for_run(backend, 1, data.interval, lambda: data.largest)
    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        return course(algorithm, data, **counts, backend=backend, settings=settings, frame=start.frame())


def _deliver(covered: Course, facts: dict[str, str], title: str, output: CourseOutput) -> None:
    from strapgen.navigation.courses.course_report import CourseResult

    format = output.format or ("text" if output.file is None else "csv")
    replace(output, format=format).show(CourseResult(facts, covered, title))
