"""strapgen converge."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.catalogue import MOTIONS
from strapgen.cli.inputs import MotionSettings, pairs
from strapgen.cli.options import Previous, StepAlgorithm, TableauFile, check_format, chosen
from strapgen.cli.progress import track
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.experiments.convergence import Convergence

_Text = str | None


def converge(
    algorithm: StepAlgorithm,
    methods: Annotated[
        _Text,
        typer.Option(
            "--method", metavar="NAME,...", help="Integration methods.  [default: rk4]", show_default=False
        ),
    ] = None,
    tableau: TableauFile = None,
    increments: Annotated[
        _Text,
        typer.Option(
            "--increments",
            metavar="N",
            help="Angle increments a step, 1 to 8, or enough: what the method needs.  [default: 2]",
            show_default=False,
        ),
    ] = None,
    previous: Previous = None,
    backend: Annotated[
        str, typer.Option("--backend", help="Back end; exact (40 digits) shows any order. See strapgen list.")
    ] = "exact",
    motion: Annotated[
        _Text, typer.Option("--motion", help="Motion.  [default: coning]", show_default=False)
    ] = None,
    settings: MotionSettings = None,
    steps: Annotated[
        str, typer.Option("--steps", metavar="S,...", help="Ladder of steps in s, divisors of the duration.")
    ] = "1/2,1/4,1/8,1/16,1/32,1/64,1/128",
    duration: Annotated[str, typer.Option("--duration", metavar="S", help="Duration in s.")] = "2",
    fail_beyond: Annotated[
        _Text,
        typer.Option(
            "--fail-beyond",
            metavar="D",
            help="Exit with 1 if an observed order is further than this from theory.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the output.  [default: the terminal]", show_default=False),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Image file for the plot.", show_default=False)
    ] = None,
    format: Annotated[str, typer.Option("--format", help="text, json or csv.")] = "text",
) -> None:
    """Show the order of algorithms: their errors on a ladder of steps, and the slope beside the one of theory.

    Without a motion it is coning of about 1 rad/s on a constant rate, which turns in every direction.

    Example:

    \b
      strapgen converge euler --method rk1,rk2,rk4,butcher6 --increments enough \\
        --plot out/orders.png
    """  # noqa: D301
    check_format(format, "csv")
    from strapgen import catalogue
    from strapgen.backends import BACKENDS
    from strapgen.support import checks

    checks.choice("backend", backend, BACKENDS)
    limit = None if fail_beyond is None else float(checks.number("fail-beyond", fail_beyond))
    if limit is not None and limit < 0:
        raise InputError(f"fail-beyond is {fail_beyond}; a number that is not below 0 is needed")
    if motion is not None:
        checks.choice("motion", motion, MOTIONS)
    given = pairs(settings or [])
    if out is not None and plot is not None and out.resolve() == plot.resolve():
        raise InputError(f"--out and --plot are both {out}; two files are needed")
    names: list[_Text] = [None]
    if methods is not None:
        names = list(dict.fromkeys(name.strip() for name in methods.split(",") if name.strip()))
        if not names:
            raise InputError("--method names no method")
    ladder = [step.strip() for step in steps.split(",") if step.strip()]

    def choose(name: _Text) -> catalogue.Choice:
        if increments != "enough":
            return chosen(algorithm, name, tableau, increments, previous)
        one = chosen(algorithm, name, tableau, None, previous)
        if one.method is None:
            raise InputError(f"--increments enough does not go with {algorithm}; a number does")
        return replace(one, increments=catalogue.enough(one.method))

    choices = [choose(name) for name in names]
    import numpy as np

    from strapgen.experiments import convergence
    from strapgen.reports.convergence import convergence_csv, convergence_text
    from strapgen.simulation import motions
    from strapgen.simulation.motions import motion as make_motion
    from strapgen.support.files import write_files

    if motion is None and not settings:
        given = motions.GENERAL
    profile = make_motion(motion or "coning", **given)
    with np.errstate(all="ignore"):  # a step that is too long for a method is part of the picture
        runs = (convergence.converge(choice, profile, ladder, duration, backend) for choice in choices)
        found = list(track(runs, "running", len(choices)))
    words = ", ".join(f"{key}={value}" for key, value in given.items())
    title = f"{duration} s of {profile.name} motion, {words}; {backend}"
    if format == "json":
        text = json.dumps([one.as_dict() for one in found])
    elif format == "csv":
        text = convergence_csv(found).rstrip("\n")
    else:
        text = convergence_text(found, title)
    files: dict[str, str | bytes] = {}
    if out is not None:
        files[str(out)] = f"{text}\n"
    if plot is not None:
        from strapgen.reports import plots

        files[str(plot)] = plots.convergence_image(found, title, plot)
    write_files(Path(), files)
    if out is None:
        typer.echo(text)
    far = [one for one in found if limit is not None and not _within(one, limit)]
    if far:
        names_far = ", ".join(one.kernel for one in far)
        typer.echo(f"strapgen: the observed order is off by more than {fail_beyond}: {names_far}", err=True)
        raise typer.Exit(1)


def _within(one: Convergence, limit: float) -> bool:
    """Tell whether an observed order is near the one of theory; one that is hidden, or has no theory, is not."""
    return (
        one.observed is not None and one.predicted is not None and abs(one.observed - one.predicted) <= limit
    )
