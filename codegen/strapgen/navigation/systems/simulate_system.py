"""`simulate` with a described system: its attitude beside that of a motion, or along a recording."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from strapgen.cli.option_groups import stated
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.cli.fixed_options import FixedOptions
    from strapgen.cli.options import MethodOptions
    from strapgen.lab.recordings.recording import Recording
    from strapgen.lab.run_options import RunOptions, RunOutput, SampleSource
    from strapgen.navigation.systems.system_backends import SystemRunner
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
    others = {"--orthonormalize": intervals.orthonormalize, "--scheme": intervals.scheme}
    refuse_options(method, fixed, [option for option, value in others.items() if value is not None])
    fixed.check_backend(backend)
    output.check(name, *source.files)
    if source.motion is None:
        if intervals.initial is not None or intervals.record is not None:
            raise InputError("--initial-deg and --record of a described system go with --motion")
        return _on_recording(name, backend, source, fixed, output)
    if output.print_every is not None:
        raise InputError("--print does not go with a described system; --record and --format csv do")
    from strapgen.cli.progress import waiting
    from strapgen.lab.runs_report import RunResult
    from strapgen.navigation.systems.system_runs import simulate_system

    description = described_at(name, source)
    runner = runner_of(description, backend, fixed)
    profile, record = source.profile(), intervals.record
    assert source.duration is not None, "a motion has a duration"
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


def _on_recording(
    name: str, backend: str, source: SampleSource, fixed: FixedOptions, output: RunOutput
) -> None:
    """Run along recorded gyro data, and deliver the attitude."""
    from strapgen.lab.runs_report import HistoryResult
    from strapgen.navigation.systems.system_runs import attitude_output, system_history

    data = recorded(source)
    runner = runner_of(described_along(name, data), backend, fixed)
    elements = attitude_output(runner.system).signal.elements
    history = system_history(runner, data)
    facts = facts_of(runner, name) | {"source": str(source.file)} | source.facts
    title = f"{name}, {backend}: attitude along {source.file.name}"
    replace(output, format=output.format or "csv").show(
        HistoryResult(facts, replace(history, elements=elements), plot_title=title)
    )


def recorded(source: SampleSource) -> Recording:
    """Read the recorded data of a run, in whole pulses of the gyro if they are stated."""
    data = source.recording()
    if source.pulse is None:
        return data
    from strapgen.run.increments import pulses

    return replace(data, increments=pulses(data.increments[:, None], source.pulse)[:, 0])


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
    from strapgen.navigation.systems.system_backends import system_runner

    return system_runner(description, backend, fixed.settings(1))


def facts_of(runner: SystemRunner, name: str) -> dict[str, Any]:
    """Return what a report says first."""
    rate = runner.system.sample_hz
    return {"system": name, "backend": runner.backend, "sample_hz": float(rate)}
