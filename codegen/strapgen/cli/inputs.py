"""What several commands run algorithms on: a motion, recorded increments or recorded rates, through gyro pulses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_Text = str | None

MotionName = Annotated[
    _Text,
    typer.Option("--motion", help="constant, sinusoidal, coning or polynomial.", show_default=False),
]
MotionSettings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE...", help="Parameters of the motion; see strapgen list."),
]
RunStep = Annotated[_Text, typer.Option("--step", metavar="S", help="Step in s.", show_default=False)]
Duration = Annotated[
    _Text, typer.Option("--duration", metavar="S", help="Duration in s.", show_default=False)
]
IncrementsFile = Annotated[
    Path | None,
    typer.Option("--increments-csv", help="Recorded increments instead: columns t, dx, dy, dz; s, rad."),
]
RatesFile = Annotated[
    Path | None,
    typer.Option("--rates-csv", help="Recorded rates instead: first four columns time in s, three rates."),
]
RateUnit = Annotated[
    _Text, typer.Option("--rate-unit", help="deg/s or rad/s, for --rates-csv.", show_default=False)
]
ResampleHz = Annotated[
    _Text,
    typer.Option(
        "--resample-hz",
        metavar="HZ",
        help="Integrate uneven recorded rates over an even grid.",
        show_default=False,
    ),
]
Pulse = Annotated[
    _Text,
    typer.Option(
        "--pulse-arcsec",
        metavar="ANGLE",
        help="Angle of a gyro pulse in arc seconds: increments become whole pulses, the rest is carried on.",
        show_default=False,
    ),
]


@dataclass(frozen=True)
class Inputs:
    """Increments of a run, and the truth where it is known.

    Parameters
    ----------
    increments : array, (N, K, 3)
        In rad.
    truth : array, (1 + N, 3, 3), or None
    step : float
        In s.
    title : str
        What they are, for a reader.
    """

    increments: NDArray[Any]
    truth: NDArray[Any] | None
    step: float
    title: str


def check_source(
    motion: _Text,
    settings: list[str] | None,
    step: _Text,
    duration: _Text,
    increments_csv: Path | None,
    rates_csv: Path | None,
    rate_unit: _Text,
    resample_hz: _Text,
) -> None:
    """Check that one source of increments is given, with the options that go with it and no others."""
    sources = {"--motion": motion, "--increments-csv": increments_csv, "--rates-csv": rates_csv}
    chosen = [name for name, value in sources.items() if value is not None]
    if len(chosen) != 1:
        raise InputError(f"one of {', '.join(sources)} is needed; {' and '.join(chosen) or 'none'} given")
    if motion is None:
        _refuse({"--set": settings, "--step": step, "--duration": duration}, "--motion", chosen[0])
    else:
        for name, value in (("--step", step), ("--duration", duration)):
            if value is None:
                raise InputError(f"--motion needs {name} in s")
    if rates_csv is None:
        _refuse({"--rate-unit": rate_unit, "--resample-hz": resample_hz}, "--rates-csv", chosen[0])
    elif rate_unit is None:
        raise InputError("--rates-csv needs --rate-unit deg/s or rad/s")


def _refuse(options: dict[str, Any], owner: str, chosen: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name} goes with {owner}, not with {chosen}")


def pairs(settings: list[str]) -> dict[str, str]:
    """Read settings of the form key=value."""
    found: dict[str, str] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key:
            raise InputError(f"--set {setting!r} is no setting; key=value is needed")
        if key in found:
            raise InputError(f"--set {key} is given twice")
        found[key] = value
    return found


def arcseconds(text: str | None) -> float | None:
    """Return the angle of a pulse, given in arc seconds, in rad."""
    from strapgen.support import checks

    if text is None:
        return None
    return math.radians(float(checks.number("pulse-arcsec", text, positive=True)) / 3600)


def read_inputs(
    samples: int,
    motion: _Text,
    settings: list[str] | None,
    step: _Text,
    duration: _Text,
    increments_csv: Path | None,
    rates_csv: Path | None,
    rate_unit: _Text,
    resample_hz: _Text,
    pulse: float | None,
    previous: int = 0,
) -> Inputs:
    """Return the increments that the options of a command stand for, `samples` of them a step and those before it."""
    import numpy as np

    from strapgen.backends.increments import pulses, windows
    from strapgen.simulation import recording
    from strapgen.simulation.motions import motion as make_motion
    from strapgen.support import checks

    truth = None
    if motion is not None:
        profile = make_motion(motion, **pairs(settings or []))
        h = checks.number("step", step or "", positive=True)
        steps = checks.multiple(
            "duration", checks.number("duration", duration or "", positive=True), "step", h
        )
        increments, length = profile.increments(h, steps, samples, previous), float(h)
        truth = profile.attitude(np.arange(1 + steps) * length)
        title = f"{motion} motion, {steps} steps of {step} s"
    else:
        if increments_csv is not None:
            data = recording.read_increments(increments_csv)
        else:
            data = recording.read_rates(rates_csv or "", rate_unit or "", resample_hz)
        steps = max(0, len(data.increments) - previous) // samples
        if steps < 1:
            raise InputError(
                f"the recording holds {len(data.increments)} increments; a step needs {samples + previous}"
            )
        increments = windows(data.increments[: previous + steps * samples], samples, previous)
        length = data.interval * samples
        title = f"{(increments_csv or rates_csv or Path()).name}, {steps} steps of {length:.6g} s"
    if pulse is not None:
        increments = pulses(increments, pulse, previous)
    return Inputs(increments, truth, length, title)
