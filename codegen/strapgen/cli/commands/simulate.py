"""The command ``strapgen simulate`` runs one algorithm on a motion or a recording."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.catalogue import MOTIONS
from strapgen.cli.fixed_options import RUN_OPTIONS, FixedOptions
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, StepAlgorithm
from strapgen.cli.output import Output
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

    orthonormalize: Annotated[
        _Text,
        typer.Option(
            "--orthonormalize",
            metavar="S",
            help="Time from one orthonormalization to the next in s.  [default: never]",
            show_default=False,
        ),
    ] = None
    scheme: Annotated[
        _Text,
        typer.Option(
            "--scheme",
            help="Kernel that orthonormalizes; see strapgen list.  [default: the scheme of the thesis]",
            show_default=False,
        ),
    ] = None
    record: Annotated[
        _Text,
        typer.Option(
            "--record",
            metavar="S",
            help="Time from one record to the next in s; it must divide the duration.  [default: every step]",
            show_default=False,
        ),
    ] = None


@dataclass(frozen=True)
class RunOutput(Output):
    """Where the result of a run goes; without --format, the attitude along a recording is CSV."""

    plot: Annotated[
        Path | None, typer.Option("--plot", help="Image file for the plots.", show_default=False)
    ] = None
    format: Annotated[
        _Text,
        typer.Option(
            "--format",
            help="Format of the output: text, json or csv.  [default: text; csv for recorded data]",
            show_default=False,
        ),
    ] = None


@grouped
def simulate(
    algorithm: StepAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    backend: Annotated[
        str,
        typer.Option("--backend", help="Back end: numpy, c, c-float, c-q31, c-q15, fixed-model or exact."),
    ] = "numpy",
    source: SampleSource,
    intervals: Annotated[Intervals, Shown(before="increments_csv")],
    fixed: Annotated[FixedOptions, Shown(only=RUN_OPTIONS)],
    output: RunOutput,
    matrices: Annotated[
        bool,
        typer.Option("--matrices", help="Add the computed and the true matrices to the JSON output."),
        Shown(before="format"),
    ] = False,
) -> None:
    """Run an algorithm on a motion with known attitude, or on recorded gyro data.

    With a motion you see the drift, scale and skew of the computed attitude; along a recording, the attitude itself.

    Recorded times must be evenly spaced unless you give --resample-hz. The rate is then taken as linear from one sample
    to the next, across intervals of up to ten times the median.

    Fixed-point formats are chosen for the increments of the run, or for --max-rate-deg-s if you give it.

    Example:

    \b
      strapgen simulate euler --method rk4 --increments 2 --backend c \\
        --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 \\
        --step 0.125 --duration 180 --orthonormalize 5 --record 5

    \b
      strapgen simulate dcm --backend c --rates-csv gyro.csv \\
        --rate-unit deg/s --resample-hz 100 --out out/attitude.csv
    """  # noqa: D301
    choice = method.choose(algorithm)
    from strapgen.backends import BACKENDS

    checks.choice("backend", backend, BACKENDS)
    if source.motion is not None:
        checks.choice("motion", source.motion, MOTIONS)
    output.check(algorithm, method.tableau, source.increments_csv, source.rates_csv)
    source.check()
    if matrices and source.motion is None:
        raise InputError("--matrices goes with --motion")
    if matrices and output.format != "json":
        raise InputError("--matrices goes with --format json; --format csv has the matrices")
    fixed.check_backend(backend)

    import numpy as np

    from strapgen import backends

    def build(seconds: float, largest: Callable[[], float]) -> Backend:
        settings = fixed.settings_for_run(backend, choice.increments_per_step, seconds, largest)
        return backends.backend(
            choice, backend=backend, orthonormalization=intervals.scheme, settings=settings
        )

    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        if source.motion is None:
            text, image = _on_recording(build, choice, source, intervals, output)
        else:
            text, image = _on_motion(build, choice, source, intervals, output, matrices)
    output.deliver(text, image)


_Build = Callable[[float, Callable[[], float]], "Backend"]


def _facts(backend: Backend, choice: Choice) -> dict[str, Any]:
    facts = {"algorithm": choice.name, "method": choice.method_name, "increments": backend.increments}
    if backend.previous:
        facts["previous"] = backend.previous
    return facts | {"backend": backend.name}


def _on_motion(
    build: _Build,
    choice: Choice,
    source: SampleSource,
    intervals: Intervals,
    output: Output,
    matrices: bool,
) -> tuple[str, bytes | None]:
    """Simulate; return the output and, if there is a file for it, the image."""
    from strapgen.reports import plots
    from strapgen.reports.runs import matrices_data, run_csv, run_data, run_text
    from strapgen.simulation import runs

    pulse = source.pulse
    profile = source.profile()
    step, duration = source.step or "", source.duration or ""
    samples, previous = choice.increments_per_step, choice.previous
    backend = build(
        float(checks.number("step", step, positive=True)),
        lambda: runs.largest_increment(profile, step, duration, samples, pulse, previous),
    )
    run = runs.simulate(backend, profile, step, duration, intervals.orthonormalize, intervals.record, pulse)
    image = None
    if output.plot is not None:
        title = f"{backend.kernel}, {backend.name}: {profile.name} motion, step {step} s"
        image = plots.run_image(run, title, output.plot)
    if output.format == "csv":
        return run_csv(run), image
    facts = _facts(backend, choice) | {
        "motion": profile.name,
        "step_s": float(checks.number("step", step)),
        "duration_s": float(checks.number("duration", duration)),
    }
    if output.format != "json":
        return run_text(run, facts), image
    data = run_data(run, facts)
    return json.dumps(data | matrices_data(run) if matrices else data), image


def _on_recording(
    build: _Build, choice: Choice, source: SampleSource, intervals: Intervals, output: Output
) -> tuple[str, bytes | None]:
    """Propagate recorded data; return the output and, if there is a file for it, the image."""
    from strapgen.reports import plots
    from strapgen.reports.runs import history_csv, history_data, history_text
    from strapgen.simulation import recording

    pulse = source.pulse
    data = source.recording()
    backend = build(data.interval * choice.increments_per_step, lambda: data.largest + (pulse or 0.0))
    history = recording.propagate(backend, data, intervals.orthonormalize, intervals.record, pulse)
    image = None
    if output.plot is not None:
        title = f"{backend.kernel}, {backend.name}: attitude along {source.file.name}"
        image = plots.history_image(history, backend.elements, title, output.plot)
    facts = _facts(backend, choice) | {"source": str(source.file)}
    if output.format == "text":
        return history_text(history, backend.elements, facts), image
    if output.format == "json":
        return json.dumps(history_data(history, backend.elements, facts)), image
    return history_csv(history, backend.elements), image
