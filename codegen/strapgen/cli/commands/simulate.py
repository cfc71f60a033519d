"""The command ``strapgen simulate`` runs one algorithm on a motion or a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from strapgen.catalogue import MOTIONS, RUN_MOTIONS
from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, OneBackend, StepAlgorithm, one, option
from strapgen.cli.output import Output, format_option, plot_option
from strapgen.cli.sample_source import SampleSource
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.backends import Backend
    from strapgen.catalogue import Choice

_Text = str | None


@dataclass(frozen=True)
class Intervals:
    """Options of the times from one orthonormalization, or one record, to the next."""

    panel: ClassVar[str] = "Run"

    orthonormalize: Annotated[
        _Text,
        option(
            "--orthonormalize",
            metavar="S",
            help="Time from one orthonormalization to the next in s.  [default: never]",
        ),
    ] = None
    scheme: Annotated[
        _Text,
        option(
            "--scheme",
            metavar="NAME",
            help="Kernel that orthonormalizes; strapgen list kernels shows all.  [default: the thesis's scheme]",
        ),
    ] = None
    record: Annotated[
        _Text,
        option(
            "--record",
            metavar="S",
            help="Time from one record to the next in s; it must divide the duration.  [default: every step]",
        ),
    ] = None


@dataclass(frozen=True)
class RunOutput(Output):
    """Where the result of a run goes; without --format, the attitude along a recording is CSV."""

    plot: Annotated[Path | None, plot_option("the plots")] = None
    format: Annotated[_Text, format_option(Output.formats, "  [default: text; csv for recorded data]")] = None


@grouped
def simulate(
    algorithm: StepAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    backend: OneBackend = "numpy",
    source: SampleSource,
    intervals: Intervals,
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    output: RunOutput,
    matrices: Annotated[
        bool,
        option(
            "--matrices", help="Add the computed and the true matrices to the JSON output.", panel="Output"
        ),
    ] = False,
) -> None:
    """Run an algorithm on a motion, or on recorded gyro data.

    The true attitude of a motion is known, so that you see the drift, scale and skew of the computed attitude; along a
    recording you see the attitude itself.

    Recorded times must be evenly spaced unless you give --resample-hz. The rate is then taken as linear from one sample
    to the next, across intervals of up to ten times the median.

    Fixed-point formats are chosen for the increments of the run, or for --max-rate-deg-s if you give it.

    Example: strapgen simulate euler --method rk4 --increments 2 --backend c --motion coning --set a_deg_s=10 b_deg_s=10
    g_deg_s=10 --step 0.125 --duration 180 --orthonormalize 5 --record 5

    Example: strapgen simulate dcm --backend c --rates-csv gyro.csv --rate-unit deg/s --resample-hz 100
    --out out/attitude.csv
    """
    choice = method.choose(algorithm)
    from strapgen.backends import BACKENDS

    one("--backend", backend)
    checks.choice("backend", backend, BACKENDS)
    if source.motion is not None:
        checks.choice("motion", source.motion, {**MOTIONS, **RUN_MOTIONS})
    output.check(algorithm, *method.files, source.increments_csv, source.rates_csv)
    source.check()
    if matrices and source.motion is None:
        raise InputError("--matrices goes with --motion")
    if matrices and output.format != "json":
        raise InputError("--matrices goes with --format json; --format csv has the matrices")
    fixed.check_backend(backend)
    fixed.check_pulse(source.pulse_arcsec)

    import numpy as np

    from strapgen import backends

    def build(seconds: float, largest: Callable[[], float]) -> Backend:
        settings = fixed.settings_for_run(backend, choice.increments_per_step, seconds, largest)
        return backends.backend(
            choice, backend=backend, orthonormalization=intervals.scheme, settings=settings
        )

    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        if source.motion is None:
            _on_recording(build, choice, source, intervals, output)
        else:
            _on_motion(build, choice, source, intervals, output, matrices)


#: Most records that are written: the text of one takes some hundred bytes.
_MOST_RECORDS = 2_000_000


def _refuse_many(steps: float, step: float, record: _Text) -> None:
    """Refuse a run of more records than can be written, before it begins."""
    interval = 0.0 if record is None else float(checks.number("record", record, positive=True))
    records = steps / max(1.0, interval / step)
    if _MOST_RECORDS < records <= checks.MOST:  # more steps than that are refused as such
        raise InputError(
            f"{records:.0f} records are too many, up to {_MOST_RECORDS} are written; --record S thins them"
        )


_Build = Callable[[float, Callable[[], float]], "Backend"]


def _facts(backend: Backend, choice: Choice) -> dict[str, Any]:
    facts = {"algorithm": choice.name, "method": choice.method_name, "increments": backend.increments}
    if backend.previous:
        facts["previous"] = backend.previous
    if backend.ahead:
        facts["ahead"] = backend.ahead
    return facts | {"backend": backend.name}


def _on_motion(
    build: _Build,
    choice: Choice,
    source: SampleSource,
    intervals: Intervals,
    output: Output,
    matrices: bool,
) -> None:
    """Simulate, and deliver the run."""
    from strapgen.cli.progress import waiting
    from strapgen.reports import plots
    from strapgen.reports.runs import run_report
    from strapgen.simulation import runs

    pulse = source.pulse
    profile = source.profile()
    step, duration = source.step or "", source.duration or ""
    samples, beside = choice.increments_per_step, (choice.previous, choice.ahead)
    length = float(checks.number("step", step, positive=True))
    _refuse_many(float(checks.number("duration", duration, positive=True)) / length, length, intervals.record)
    backend = build(
        length,
        lambda: runs.largest_increment(profile, step, duration, samples, pulse, beside),
    )
    pulse = pulse or backend.count
    with waiting(f"running {backend.kernel}"):
        run = runs.simulate(
            backend, profile, step, duration, intervals.orthonormalize, intervals.record, pulse
        )
    facts = _facts(backend, choice) | {
        "motion": profile.name,
        "step_s": float(checks.number("step", step)),
        "duration_s": float(checks.number("duration", duration)),
    }
    title = f"{backend.kernel}, {backend.name}: {profile.name} motion ({source.words}), step {step} s"
    output.report(
        run_report(run, facts, f"{profile.name} ({source.words})", matrices),
        lambda path: plots.run_image(run, title, path),
    )


def _on_recording(
    build: _Build, choice: Choice, source: SampleSource, intervals: Intervals, output: Output
) -> None:
    """Propagate recorded data, and deliver the attitude."""
    from strapgen.cli.progress import waiting
    from strapgen.reports import plots
    from strapgen.reports.runs import history_report
    from strapgen.simulation import recording, whole_recordings

    pulse = source.pulse
    data = source.recording()
    length = data.interval * choice.increments_per_step
    _refuse_many(len(data.increments) / choice.increments_per_step, length, intervals.record)
    backend = build(length, lambda: data.largest + (pulse or 0.0))
    pulse = pulse or backend.count
    with waiting(f"running {backend.kernel}"):
        options = (intervals.orthonormalize, intervals.record, pulse)
        if whole_recordings.covers(choice, backend.name):
            history = whole_recordings.propagate_whole(choice, backend.name, data, *options)
        else:
            history = recording.propagate(backend, data, *options)
    title = f"{backend.kernel}, {backend.name}: attitude along {source.file.name}"
    facts = _facts(backend, choice) | {"source": str(source.file)}
    replace(output, format=output.format or "csv").report(
        history_report(history, backend.elements, facts),
        lambda path: plots.history_image(history, backend.elements, title, path),
    )
