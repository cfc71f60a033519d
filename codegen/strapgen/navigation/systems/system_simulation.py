"""Described systems in the commands ``simulate``, ``compare``, ``certify`` and ``strapdown``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from strapgen.cli.option_groups import stated
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import DescribedAlgorithms, inertial, whole_recording
from strapgen.navigation.systems.built_in import is_system

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.cli.fixed_options import FixedOptions
    from strapgen.cli.options import MethodOptions, SeveralMethods
    from strapgen.cli.output import Output
    from strapgen.lab.motions.motions import Motion
    from strapgen.lab.recordings.recording import InertialRecording, Recording
    from strapgen.lab.run_options import RecordingOptions, RunOptions, RunOutput, SampleSource
    from strapgen.navigation.strapdown_command import CourseOutput, Start
    from strapgen.navigation.systems.system_runner import SystemMemory, SystemRunner
    from strapgen.navigation.systems.wiring import Description


#: The options of fixed point that go with a system, whose inputs have their ranges in its file.
FIXED = ("--word", "--rounding", "--carry", "--drift-allowance")


def simulated_system(
    name: str,
    method: MethodOptions,
    backend: str,
    source: SampleSource,
    intervals: RunOptions,
    fixed: FixedOptions,
    output: RunOutput,
) -> None:
    """Simulate a described system, and deliver the run."""
    others = {
        "--orthonormalize": intervals.orthonormalize,
        "--scheme": intervals.scheme,
        "--order": intervals.order,
    }
    refuse_options(method, fixed, [option for option, value in others.items() if value is not None])
    fixed.check_backend(backend)
    output.check(name, *source.files)
    if source.motion is None:
        if intervals.record is not None:
            raise InputError("--record of a described system goes with --motion")
        return _on_recording(name, backend, source, intervals, fixed, output)
    if output.print_every is not None:
        raise InputError("--print does not go with a described system; --record and --format csv do")
    from strapgen.cli.progress import waiting
    from strapgen.lab.runs_report import RunResult
    from strapgen.navigation.systems.system_flight import over_earth
    from strapgen.navigation.systems.system_runs import simulate_system

    description = described_at(name, source)
    runner = runner_of(description, backend, fixed)
    profile, record = source.profile(), intervals.record
    assert source.duration is not None, "a motion has a duration"
    if over_earth(profile) is not None:
        return _over_earth(name, runner, profile, source, intervals, output)
    with waiting(f"running {name}"):
        run = simulate_system(runner, profile, source.duration, record, intervals.start(), source.force)
    facts = facts_of(runner, name) | {
        "motion": profile.name,
        "duration_s": float(source.duration),
        "specific_force_m_s2": list(source.force),
    }
    facts |= source.facts
    title = f"{name}, {backend}: {source.described(profile.name, ' motion')}"
    matrices, words = run if output.matrices else None, source.described(profile.name)
    output.show(RunResult(facts, run, output.title, matrices, words, plot_title=title))


def _over_earth(
    name: str,
    runner: SystemRunner,
    profile: Motion,
    source: SampleSource,
    intervals: RunOptions,
    output: RunOutput,
) -> None:
    """Run on a motion over the earth, and deliver the errors of attitude, velocity and position."""
    for option, given in (
        ("--initial-deg", intervals.initial is not None),
        ("--specific-force", source.specific_force is not None),
        ("--matrices", output.matrices),
    ):
        if given:
            raise InputError(f"{option} does not go with a motion over the earth, which has its own")
    from strapgen.cli.progress import waiting
    from strapgen.navigation.systems.system_flight import FlightResult, fly

    assert source.duration is not None, "a motion has a duration"
    with waiting(f"running {name}"):
        flight = fly(runner, profile, source.duration, intervals.record)
    facts = facts_of(runner, name) | {"motion": profile.name, "duration_s": float(source.duration)}
    title = f"{name}, {runner.backend}: {source.described(profile.name, ' motion')}"
    output.show(FlightResult(facts | source.facts, flight, output.title, plot_title=title))


def _on_recording(
    name: str,
    backend: str,
    source: SampleSource,
    intervals: RunOptions,
    fixed: FixedOptions,
    output: RunOutput,
) -> None:
    """Run along recorded gyro data, and deliver the attitude."""
    from strapgen.lab.recordings.recording import along_pieces
    from strapgen.lab.runs_report import HistoryResult
    from strapgen.navigation.systems.system_runs import attitude_output, system_history

    data = recorded(source)
    runner = runner_of(described_along(name, data), backend, fixed)
    elements = attitude_output(runner.system).signal.elements
    history = along_pieces(
        data, lambda piece: system_history(runner, piece, intervals.start()), runner.system.cycle
    )
    source.say_remarks(data)
    facts = facts_of(runner, name) | {"source": source.source} | source.facts
    title = f"{name}, {backend}: attitude along {source.file.name}"
    replace(output, format=output.format or "csv").show(
        HistoryResult(facts, replace(history, elements=elements), plot_title=title)
    )


def recorded(source: SampleSource) -> Recording:
    """Read the recorded data of a run, in whole pulses of the gyro if they are stated."""
    data = source.recorded()
    if source.pulse is None:
        return data
    from strapgen.run.increments import pulses

    return replace(data, samples=pulses(data.samples[:, None], source.pulse)[:, 0])


def refuse_options(method: MethodOptions | None, fixed: FixedOptions, others: list[str]) -> None:
    """Refuse options of an algorithm that a described system states itself."""
    of_method = [] if method is None else stated(method)
    for option in [*of_method, *others, *(option for option in stated(fixed) if option not in FIXED)]:
        raise InputError(f"{option} does not go with a described system, whose file states what it does")


def described_at(name: str, source: SampleSource) -> Description:
    """Return a system at the rate of its file, or with the stated step from sample to sample."""
    from strapgen.navigation.systems.wiring import described

    return described(name, None if source.step is None else 1 / source.step)


def described_along(name: str, data: Recording) -> Description:
    """Return a system at the rate of a recording."""
    from strapgen.navigation.systems.system_runs import rate_of
    from strapgen.navigation.systems.wiring import described

    return described(name, rate_of(data))


def runner_of(description: Description, backend: str, fixed: FixedOptions) -> SystemRunner:
    """Return a system on a back end."""
    from strapgen.navigation.systems.system_runner import system_runner

    return system_runner(description, backend, fixed.settings(1))


def facts_of(runner: SystemRunner, name: str) -> dict[str, Any]:
    """Return the facts at the head of a report."""
    rate = runner.system.sample_hz
    return {"system": name, "backend": runner.backend, "sample_hz": float(rate)}


def compared_system(
    name: str,
    methods: SeveralMethods,
    stated: list[str],
    backends: tuple[Sequence[str], str],
    files: tuple[Sequence[Path] | None, bool],
    source: SampleSource,
    fixed: FixedOptions,
    output: Output,
) -> None:
    """Compare a described system on back ends, and exit with 1 if a pass is outside its bound."""
    refuse_options(methods, fixed, stated)
    output.check(name, *source.files)
    from strapgen import registration
    from strapgen.cli.progress import waiting
    from strapgen.lab.compare_command import with_counts
    from strapgen.navigation.systems.system_comparison import SystemComparisonResult, compare_system

    names, reference = backends
    description, inputs, title, begin = _inputs(name, source)
    with waiting(f"running {name}"):
        runners = {}
        for path in files[0] or ():
            reader = registration.extension("navigation.source-files", "--source")
            runners[path] = reader(path, description, [name], files[1])
        settings = with_counts(fixed.settings(1), {path: stated for path, (_, stated) in runners.items()})
        of_files = {str(path): runner for path, (runner, _) in runners.items()}
        rows = compare_system(description, names, reference, inputs, settings, of_files, begin)
    output.show(SystemComparisonResult(rows, f"{name}: {title}", reference))
    broken = [f"{row.output} on {row.backend}" for row in rows if row.share is not None and row.share > 1]
    if broken:
        typer.echo(f"strapgen: outside the certified bound: {', '.join(broken)}", err=True)
        raise typer.Exit(1)


def _inputs(
    name: str, source: SampleSource
) -> tuple[Description, dict[str, NDArray[Any]], str, Callable[[SystemRunner], SystemMemory]]:
    """Return the system, the samples of its inputs, their source in words, and the beginning of a run."""
    import numpy as np

    from strapgen.lab.sensor_errors.measured_motions import both_increments
    from strapgen.navigation.systems.system_flight import begun, over_earth
    from strapgen.navigation.systems.system_runner import SystemRunner
    from strapgen.navigation.systems.system_runs import cycles_of, samples

    if source.motion is None:
        data = whole_recording(recorded(source))
        description = described_along(name, data)
        angle = np.asarray(data.samples)
        return (
            description,
            samples(description, angle, np.zeros_like(angle)),
            Path(source.file).name,
            SystemRunner.begin,
        )
    description, profile = described_at(name, source), source.profile()
    assert source.duration is not None, "a motion has a duration"
    system = description.system
    count, interval = cycles_of(system, source.duration), 1 / system.sample_hz
    angle, velocity = both_increments(profile, profile.attitude, source.force, interval, count)
    title = f"{source.described(profile.name, ' motion')}, {count} cycles of {float(interval):.6g} s"
    true = over_earth(profile)
    begin = SystemRunner.begin if true is None else partial(begun, motion=true)
    return description, samples(description, angle, velocity), title, begin


def system_along(
    name: str,
    others: Iterable[str],
    backend: str,
    source: SampleSource,
    measured: tuple[InertialRecording, Motion | None],
    errors: str | None,
    start: Start,
    fixed: FixedOptions,
    output: CourseOutput,
) -> None:
    """Run a described system along a recording, as sensors with errors measure it, and deliver its outputs.

    `measured`: the increments, and the motion over the earth that they are of, from whose truth the system begins.
    """
    refuse_options(None, fixed, [*others, *([] if output.plot is None else ["--plot"])])
    data, motion = measured
    if motion is None and any(start.frame_rate or ()):
        raise InputError(
            "--frame-rate-deg-h does not go with a described system, whose navigation frame rests"
        )
    fixed.check_backend(backend)
    output.check(name, *source.files)
    from strapgen.cli.progress import waiting
    from strapgen.navigation.systems import system_flight
    from strapgen.navigation.systems.system_runs import SystemCourseResult, begun, system_course

    runner = runner_of(described_along(name, data), backend, fixed)
    true = None if motion is None else system_flight.over_earth(motion)
    memory = None if true is None else system_flight.begun(runner, true)
    if any(start.initial or ()) and memory is None:
        memory, _ = begun(runner, start.matrix())
    with waiting(f"running {name}"):
        course = system_course(runner, data, memory)
    if motion is None:
        source.say_remarks(data)
        facts = facts_of(runner, name) | {"source": source.source}
    else:
        facts = facts_of(runner, name) | {"motion": source.described(motion.name)}
    facts |= {} if errors is None else {"errors": errors}
    format = output.format or ("text" if output.file is None else "csv")
    replace(output, format=format).show(SystemCourseResult(facts, course))


def certified_system(
    name: str,
    others: list[str],
    method: MethodOptions,
    backend: str,
    source: RecordingOptions,
    intervals: RunOptions,
    fixed: FixedOptions,
    output: Output,
) -> None:
    """Certify the rounding of a described system along a recording, stage by stage.

    The specific force is that of the recording, and zero where it has none.
    """
    refuse_options(method, fixed, others)
    fixed.check_backend(backend)
    output.check(name, source.file)
    import numpy as np

    from strapgen.cli.progress import waiting
    from strapgen.navigation.systems.system_certificate import certify_system
    from strapgen.navigation.systems.system_runs import begun, samples

    data: Recording | None = None
    with suppress(InputError):  # what is wrong with the gyro is said again
        data = inertial(source, None)
    data = whole_recording(source.load()) if data is None else data
    runner = runner_of(described_along(name, data), backend, fixed)
    angle = np.asarray(data.samples)
    velocity = np.asarray(getattr(data, "velocity_increments", np.zeros_like(angle)))
    memory, _ = begun(runner, intervals.start()) if intervals.initial is not None else (None, None)
    source.say_remarks(data)
    with waiting(f"certifying {name}"):
        result = certify_system(runner, samples(runner.fit.description, angle, velocity), memory=memory)
    output.show(replace(result, source=source.source))


SYSTEMS = DescribedAlgorithms(is_system, simulated_system, compared_system, certified_system)
