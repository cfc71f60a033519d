"""The command ``strapgen strapdown`` runs an algorithm in two speeds along a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import OneBackend, StrapdownAlgorithm, option
from strapgen.cli.progress import say_unused
from strapgen.lab.sensor_errors.sensor_options import SensorFile, read_errors, with_errors
from strapgen.navigation.courses.course_options import CourseOutput, CycleCounts, Start
from strapgen.navigation.systems.built_in import is_system


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

        return system_along(algorithm, cycles.stated, backend, (increments, errors), start, fixed, output)
    counts = cycles.counts()
    import numpy as np

    from strapgen.lab.recordings import recording
    from strapgen.navigation.courses.course_report import CourseResult
    from strapgen.navigation.courses.courses import course

    fixed.check_backend(backend)
    data = with_errors(recording.read_inertial(increments), read_errors(errors))
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
    say_unused(
        increments, covered.unused, counts["fast_cycles"] * counts.get("slow_cycles", 1), "navigation cycle"
    )
    facts = {
        "algorithm": f"{algorithm} in two speeds",
        "backend": backend,
        "source": str(increments),
    }
    facts |= {} if errors is None else {"errors": errors}
    format = output.format or ("text" if output.file is None else "csv")
    title = f"{facts['algorithm']}, {backend}: {increments.name}"
    replace(output, format=format).show(CourseResult(facts, covered, title))
