"""strapgen simulate."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.catalogue import MOTIONS
from strapgen.cli.fixed_options import (
    Allowance,
    Carry,
    MaxRate,
    Rounding,
    Word,
    check_fixed,
    settings_for_run,
)
from strapgen.cli.inputs import (
    Duration,
    IncrementsFile,
    MotionName,
    MotionSettings,
    Pulse,
    RatesFile,
    RateUnit,
    ResampleHz,
    RunStep,
    arcseconds,
    check_source,
    pairs,
)
from strapgen.cli.options import (
    Increments,
    Method,
    Previous,
    StepAlgorithm,
    TableauFile,
    check_format,
    chosen,
)
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.backends import Backend
    from strapgen.catalogue import Choice

_Text = str | None


def simulate(
    algorithm: StepAlgorithm,
    method: Method = None,
    tableau: TableauFile = None,
    increments: Increments = None,
    previous: Previous = None,
    backend: Annotated[
        str, typer.Option("--backend", help="numpy, c, c-float, c-q31, c-q15, fixed-model or exact.")
    ] = "numpy",
    motion: MotionName = None,
    settings: MotionSettings = None,
    step: RunStep = None,
    duration: Duration = None,
    orthonormalize: Annotated[
        _Text,
        typer.Option(
            "--orthonormalize",
            metavar="S",
            help="Orthonormalize every so many s.  [default: never]",
            show_default=False,
        ),
    ] = None,
    scheme: Annotated[
        _Text,
        typer.Option(
            "--scheme", help="Kernel that orthonormalizes.  [default: the thesis's]", show_default=False
        ),
    ] = None,
    record: Annotated[
        _Text,
        typer.Option(
            "--record",
            metavar="S",
            help="Record every so many s, a divisor of the duration.  [default: every step]",
            show_default=False,
        ),
    ] = None,
    increments_csv: IncrementsFile = None,
    rates_csv: RatesFile = None,
    rate_unit: RateUnit = None,
    resample_hz: ResampleHz = None,
    pulse_arcsec: Pulse = None,
    word: Word = None,
    max_rate_deg_s: MaxRate = None,
    rounding: Rounding = None,
    carry: Carry = None,
    drift_allowance: Allowance = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Image file for the plots.", show_default=False)
    ] = None,
    matrices: Annotated[
        bool, typer.Option("--matrices", help="Add all matrices to the JSON output.")
    ] = False,
    format: Annotated[
        _Text,
        typer.Option(
            "--format", help="text, json or csv.  [default: text; csv for recorded data]", show_default=False
        ),
    ] = None,
) -> None:
    """Run an algorithm on a motion with known attitude, or on recorded gyro data.

    Recorded times that are not even are refused unless --resample-hz is given; then intervals of up to ten times the
    median are bridged by a straight line.

    Formats of fixed point are chosen for the increments of the run, or for --max-rate-deg-s.

    Example:

    \b
      strapgen simulate euler --method rk4 --increments 2 --backend c \\
        --motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 \\
        --step 0.125 --duration 180 --orthonormalize 5 --record 5

    \b
      strapgen simulate dcm --backend c --rates-csv gyro.csv \\
        --rate-unit deg/s --resample-hz 100 --out out/attitude.csv
    """  # noqa: D301
    choice = chosen(algorithm, method, tableau, increments, previous)
    _check_names(backend, motion, format)
    check_source(motion, settings, step, duration, increments_csv, rates_csv, rate_unit, resample_hz)
    if motion is None and matrices:
        raise InputError("--matrices goes with --motion")
    if matrices and format != "json":
        raise InputError("--matrices goes with --format json; --format csv has the matrices")
    if out is not None and plot is not None and out.resolve() == plot.resolve():
        raise InputError(f"--out and --plot are both {out}; two files are needed")

    import numpy as np

    from strapgen.backends import backend as make_backend
    from strapgen.support.files import write_files

    samples = choice.increments_per_step, choice.previous

    stated = {
        "word": word,
        "max_rate_deg_s": max_rate_deg_s,
        "rounding": rounding,
        "carry": carry,
        "drift_allowance": drift_allowance,
    }
    check_fixed(backend, stated)
    pulse = arcseconds(pulse_arcsec)

    def ready(seconds: float, largest: Callable[[], float]) -> Backend:
        settings = settings_for_run(backend, samples[0], stated, seconds, largest)
        return make_backend(choice, backend=backend, orthonormalization=scheme, settings=settings)

    with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
        if motion is not None:
            times = (str(step), str(duration), orthonormalize, record, pulse)
            text, image = _on_motion(
                ready, choice, motion, pairs(settings or []), times, format or "text", plot, matrices, samples
            )
        else:
            text, image = _on_recording(
                ready,
                choice,
                increments_csv,
                (rates_csv, rate_unit, resample_hz),
                (orthonormalize, record, pulse),
                format or "csv",
                plot,
                samples[0],
            )
    text = text.rstrip("\n")
    files: dict[str, str | bytes] = {}
    if out is not None:
        files[str(out)] = f"{text}\n"
    if plot is not None and image is not None:
        files[str(plot)] = image
    write_files(Path(), files)
    if out is None:
        typer.echo(text)


def _check_names(backend: str, motion: str | None, format: str | None) -> None:
    from strapgen.backends import BACKENDS
    from strapgen.support import checks

    checks.choice("backend", backend, BACKENDS)
    if motion is not None:
        checks.choice("motion", motion, MOTIONS)
    if format is not None:
        check_format(format, "csv")


def _named(ready: Backend, choice: Choice) -> dict[str, Any]:
    named = {"algorithm": choice.name, "method": choice.method_name, "increments": ready.increments}
    if ready.previous:
        named["previous"] = ready.previous
    return named | {"backend": ready.name}


def _on_motion(
    make: Callable[[float, Callable[[], float]], Backend],
    choice: Choice,
    motion: str,
    settings: dict[str, str],
    times: tuple[str, str, str | None, str | None, float | None],
    format: str,
    plot: Path | None,
    matrices: bool,
    samples: tuple[int, int],
) -> tuple[str, bytes | None]:
    """Simulate; return the output and, if one is wanted, the image."""
    from strapgen.reports import plots, runs
    from strapgen.simulation.motions import motion as make_motion
    from strapgen.simulation.runs import largest_increment
    from strapgen.simulation.runs import simulate as run_simulation
    from strapgen.support import checks

    profile = make_motion(motion, **settings)
    step, duration, _, _, pulse = times
    length = float(checks.number("step", step, positive=True))
    ready = make(length, lambda: largest_increment(profile, step, duration, samples[0], pulse, samples[1]))
    run = run_simulation(ready, profile, *times)
    title = f"{ready.kernel}, {ready.name}: {profile.name} motion, step {step} s"
    image = None if plot is None else plots.run_image(run, title, plot)
    if format == "csv":
        return runs.run_csv(run), image
    named = _named(ready, choice) | {
        "motion": profile.name,
        "step_s": float(checks.number("step", step)),
        "duration_s": float(checks.number("duration", duration)),
    }
    if format == "text":
        return runs.run_text(run, named), image
    data = runs.run_data(run, named)
    return json.dumps(data | runs.matrices_data(run) if matrices else data), image


def _on_recording(
    make: Callable[[float, Callable[[], float]], Backend],
    choice: Choice,
    increments_csv: Path | None,
    rates: tuple[Path | None, str | None, str | None],
    times: tuple[str | None, str | None, float | None],
    format: str,
    plot: Path | None,
    samples: int,
) -> tuple[str, bytes | None]:
    """Propagate recorded data; return the output and, if one is wanted, the image."""
    from strapgen.reports import plots, runs
    from strapgen.simulation import recording

    rates_csv, unit, resample_hz = rates
    if increments_csv is not None:
        data = recording.read_increments(increments_csv)
    else:
        data = recording.read_rates(rates_csv or "", unit or "", resample_hz)
    ready = make(data.interval * samples, lambda: data.largest + (times[2] or 0.0))
    history = recording.propagate(ready, data, *times)
    source = increments_csv or rates_csv or Path()
    title = f"{ready.kernel}, {ready.name}: attitude along {source.name}"
    image = None if plot is None else plots.history_image(history, ready.elements, title, plot)
    named = _named(ready, choice) | {"source": str(source)}
    if format == "csv":
        return runs.history_csv(history, ready.elements), image
    if format == "text":
        return runs.history_text(history, ready.elements, named), image
    return json.dumps(runs.history_data(history, ready.elements, named)), image
