"""`strapdown` with a described system: its outputs along an inertial recording."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import read_errors, with_errors
from strapgen.navigation.systems.simulate_system import described_along, facts_of, refuse_options, runner_of

if TYPE_CHECKING:
    from strapgen.cli.fixed_options import FixedOptions
    from strapgen.navigation.courses.course_options import CourseOutput, Start


def system_along(
    name: str,
    others: Iterable[str],
    backend: str,
    sensors: tuple[Path, str | None],
    start: Start,
    fixed: FixedOptions,
    output: CourseOutput,
) -> None:
    """Run a described system along a recording, as sensors with errors measure it, and deliver its outputs."""
    increments, errors = sensors
    refuse_options(None, fixed, [*others, *([] if output.plot is None else ["--plot"])])
    if any(start.frame_rate):
        raise InputError(
            "--frame-rate-deg-h does not go with a described system, whose navigation frame rests"
        )
    fixed.check_backend(backend)
    output.check(name, increments)
    from strapgen.cli.progress import waiting
    from strapgen.lab.recordings import recording
    from strapgen.navigation.systems.system_course_report import SystemCourseResult
    from strapgen.navigation.systems.system_runs import begun, system_course

    data = with_errors(recording.read_inertial(increments), read_errors(errors))
    runner = runner_of(described_along(name, data), backend, fixed)
    memory = None
    if any(start.initial):
        memory, _ = begun(runner, start.matrix())
    with waiting(f"running {name}"):
        course = system_course(runner, data, memory)
    facts = facts_of(runner, name) | {"source": str(increments)}
    facts |= {} if errors is None else {"errors": errors}
    format = output.format or ("text" if output.file is None else "csv")
    replace(output, format=format).show(SystemCourseResult(facts, course))
