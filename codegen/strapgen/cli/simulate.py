"""strapgen simulate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.catalogue import ALGORITHMS, MOTIONS
from strapgen.cli.options import Increments, Method, check_format
from strapgen.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.backends import Backend
    from strapgen.motions import Motion
    from strapgen.recording import History

_Number = str | None


def simulate(
    algorithm: Annotated[str, typer.Argument(help="dcm, euler or cayley-klein.")],
    method: Method = None,
    increments: Increments = None,
    backend: Annotated[str, typer.Option("--backend", help="numpy, c or c-float.")] = "numpy",
    motion: Annotated[
        _Number,
        typer.Option("--motion", help="constant, sinusoidal, coning or polynomial.", show_default=False),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE...", help="Parameters of the motion; see strapgen list."),
    ] = None,
    step: Annotated[_Number, typer.Option("--step", help="Step in s.", show_default=False)] = None,
    duration: Annotated[
        _Number, typer.Option("--duration", help="Duration in s.", show_default=False)
    ] = None,
    orthonormalize: Annotated[
        _Number,
        typer.Option(
            "--orthonormalize", help="Orthonormalize every so many s.  [default: never]", show_default=False
        ),
    ] = None,
    scheme: Annotated[
        _Number,
        typer.Option(
            "--scheme", help="Kernel that orthonormalizes.  [default: the thesis's]", show_default=False
        ),
    ] = None,
    record: Annotated[
        _Number,
        typer.Option("--record", help="Record every so many s.  [default: every step]", show_default=False),
    ] = None,
    increments_csv: Annotated[
        Path | None,
        typer.Option(
            "--increments-csv", help="Propagate recorded increments: columns t, dx, dy, dz; s, rad."
        ),
    ] = None,
    rates_csv: Annotated[
        Path | None,
        typer.Option(
            "--rates-csv", help="Propagate recorded rates: first four columns time in s, three rates."
        ),
    ] = None,
    rate_unit: Annotated[
        _Number, typer.Option("--rate-unit", help="deg/s or rad/s, for --rates-csv.", show_default=False)
    ] = None,
    resample_hz: Annotated[
        _Number,
        typer.Option(
            "--resample-hz", help="Integrate uneven recorded rates over an even grid.", show_default=False
        ),
    ] = None,
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
        _Number,
        typer.Option(
            "--format", help="text, json or csv.  [default: text; csv for recorded data]", show_default=False
        ),
    ] = None,
) -> None:
    """Run an algorithm on a motion with known attitude, or on recorded gyro data.

    Example: strapgen simulate euler --method rk4 --increments 2 --backend c --motion coning
    --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.125 --duration 180 --orthonormalize 5 --record 5

    Example: strapgen simulate dcm --backend c --rates-csv gyro.csv --rate-unit deg/s --resample-hz 100
    --out attitude.csv
    """
    if format is not None:
        check_format(format, "csv")
    import numpy as np

    from strapgen import checks, output
    from strapgen.backends import BACKENDS
    from strapgen.backends import backend as make_backend
    from strapgen.catalogue import choose

    checks.choice("algorithm", algorithm, ALGORITHMS)
    choice = choose(algorithm, method, increments)
    checks.choice("backend", backend, BACKENDS)
    if motion is not None:
        checks.choice("motion", motion, MOTIONS)
    sources = {"--motion": motion, "--increments-csv": increments_csv, "--rates-csv": rates_csv}
    chosen = [name for name, value in sources.items() if value is not None]
    if len(chosen) != 1:
        raise InputError(f"one of {', '.join(sources)} is needed; {' and '.join(chosen) or 'none'} given")
    if motion is None:
        given = {"--set": settings, "--step": step, "--duration": duration, "--matrices": matrices or None}
        _refuse(given, "--motion", chosen[0])
    if rates_csv is None:
        _refuse({"--rate-unit": rate_unit, "--resample-hz": resample_hz}, "--rates-csv", chosen[0])
    elif rate_unit is None:
        raise InputError("--rates-csv needs --rate-unit deg/s or rad/s")
    for name, value in (("--step", step), ("--duration", duration)):
        if motion is not None and value is None:
            raise InputError(f"--motion needs {name} in s")

    named = {
        "algorithm": algorithm,
        "method": choice.method,
        "increments": choice.increments,
        "backend": backend,
    }
    if motion is not None:
        from strapgen.motions import motion as make_motion

        profile = make_motion(motion, **_pairs(settings or []))
        ready = make_backend(algorithm, method, increments, backend, scheme)
        times = (str(step), str(duration), orthonormalize, record)
        with np.errstate(all="ignore"):  # numbers that overflow are refused, in one line
            text = _on_motion(ready, profile, times, named, format or "text", plot, matrices)
    else:
        from strapgen import recording as recordings

        with np.errstate(all="ignore"):
            if increments_csv is not None:
                recording = recordings.read_increments(increments_csv)
            else:
                recording = recordings.read_rates(rates_csv or "", rate_unit or "", resample_hz)
            ready = make_backend(algorithm, method, increments, backend, scheme)
            history = recordings.propagate(ready, recording, orthonormalize, record)
        named["source"] = str(increments_csv or rates_csv)
        text = _of_recording(history, ready.elements, named, format or "csv", plot)
    if out is None:
        typer.echo(text.rstrip("\n"))
    else:
        output.write_file(out, text.rstrip("\n") + "\n")


def _refuse(options: dict[str, Any], owner: str, chosen: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name} goes with {owner}, not with {chosen}")


def _pairs(settings: list[str]) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key:
            raise InputError(f"--set {setting!r} is no setting; key=value is needed")
        if key in pairs:
            raise InputError(f"--set {key} is given twice")
        pairs[key] = value
    return pairs


def _on_motion(
    ready: Backend,
    profile: Motion,
    times: tuple[str, str, str | None, str | None],
    named: dict[str, Any],
    format: str,
    plot: Path | None,
    matrices: bool,
) -> str:
    from strapgen import checks, reports
    from strapgen.simulation import simulate as run_simulation

    step, duration, _, _ = times
    run = run_simulation(ready, profile, *times)
    if plot is not None:
        from strapgen.plots import plot_run

        title = f"{ready.kernel}, {named['backend']}: {profile.name} motion, step {step} s"
        plot_run(run, title, plot)
    if format == "csv":
        return reports.run_csv(run)
    named |= {
        "motion": profile.name,
        "step_s": float(checks.number("step", step)),
        "duration_s": float(checks.number("duration", duration)),
    }
    if format == "text":
        return reports.run_text(run, named)
    data = reports.run_data(run, named)
    return json.dumps(data | reports.matrices_data(run) if matrices else data)


def _of_recording(
    history: History, elements: tuple[str, ...], named: dict[str, Any], format: str, plot: Path | None
) -> str:
    from strapgen import reports

    if plot is not None:
        from strapgen.plots import plot_history

        title = f"{named['algorithm']} {named['method']}, {named['backend']}: attitude along {Path(named['source']).name}"
        plot_history(history, elements, title, plot)
    if format == "csv":
        return reports.history_csv(history, elements)
    if format == "text":
        return reports.history_text(history, elements, named)
    return json.dumps(reports.history_data(history, elements, named))
