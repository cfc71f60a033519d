"""The command ``strapgen converge`` measures the order of a step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, StepAlgorithm, limit, listed
from strapgen.cli.output import Output, as_json
from strapgen.cli.progress import track
from strapgen.cli.sample_source import MotionSettings, pairs
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.experiments.convergence import Convergence
    from strapgen.simulation.motions import Motion

_Text = str | None


@dataclass(frozen=True)
class SeveralMethods(MethodOptions):
    """Options that choose the methods to show side by side, and the number of increments of each."""

    method: Annotated[
        _Text,
        typer.Option(
            "--method",
            metavar="NAME,...",
            help="Integration methods to show side by side.  [default: rk4]",
            show_default=False,
        ),
    ] = None
    increments: Annotated[
        _Text,
        typer.Option(
            "--increments",
            metavar="N",
            help="Number of angle increments in a step, 1 to 8; or enough: as many as each method needs.  [default: 2]",
            show_default=False,
        ),
    ] = None

    def choices(self, algorithm: str) -> list[Choice]:
        """Return the algorithm with every method."""
        names: list[_Text] = [None]
        if self.method is not None:
            names = [*listed("--method", self.method, "names no method")]
        return [replace(self, method=name).choose(algorithm) for name in names]

    def choose(self, algorithm: str, *, step: bool = True) -> Choice:
        """Return the algorithm with one method; see `MethodOptions.choose`."""
        if self.increments != "enough":
            return super().choose(algorithm, step=step)
        from strapgen import catalogue

        choice = replace(self, increments=None).choose(algorithm, step=step)
        if choice.method is None:
            raise InputError(f"--increments enough does not go with {algorithm}; a number does")
        return replace(choice, increments=catalogue.enough(choice.method))


@dataclass(frozen=True)
class Ladder:
    """Options of the motion, the ladder of steps and the duration of the runs."""

    motion: Annotated[
        _Text,
        typer.Option(
            "--motion",
            help="Motion to run on: constant, sinusoidal, coning or polynomial.  [default: coning]",
            show_default=False,
        ),
    ] = None
    settings: MotionSettings = None
    steps: Annotated[
        str,
        typer.Option("--steps", metavar="S,...", help="Step lengths in s; each must divide the duration."),
    ] = "1/2,1/4,1/8,1/16,1/32,1/64,1/128"
    duration: Annotated[str, typer.Option("--duration", metavar="S", help="Duration of each run in s.")] = "2"

    def check(self) -> None:
        """Check the name of the motion."""
        from strapgen.catalogue import MOTIONS

        if self.motion is not None:
            checks.choice("motion", self.motion, MOTIONS)

    def profile(self) -> tuple[Motion, str]:
        """Return the motion, and a description of the runs in words."""
        from strapgen.simulation import motions

        parameters = pairs(self.settings or [])
        if self.motion is None and not self.settings:
            parameters = motions.GENERAL
        profile = motions.motion(self.motion or "coning", **parameters)
        words = ", ".join(f"{key}={value}" for key, value in parameters.items())
        return profile, f"{self.duration} s of {profile.name} motion, {words}"


@grouped
def converge(
    algorithm: StepAlgorithm,
    *,
    methods: Annotated[SeveralMethods, Shown(only=STEP_OPTIONS)],
    backend: Annotated[
        str,
        typer.Option(
            "--backend", help="Back end; exact (40 digits) shows even high orders. See strapgen list."
        ),
    ] = "exact",
    ladder: Ladder,
    fail_beyond: Annotated[
        _Text,
        typer.Option(
            "--fail-beyond",
            metavar="D",
            help="Exit with 1 if an observed order differs from the predicted one by more than D.",
            show_default=False,
        ),
    ] = None,
    output: Output,
) -> None:
    """Measure the order of an algorithm from its errors on a ladder of steps, and show it beside the predicted order.

    Without --motion the runs are on a coning motion of about 1 rad/s with a steady rate added, so that the body turns
    about all axes.

    Example:

    \b
      strapgen converge euler --method rk1,rk2,rk4,butcher6 --increments enough \\
        --plot out/orders.png
    """  # noqa: D301
    output.check(algorithm, methods.tableau)
    from strapgen.backends import BACKENDS

    checks.choice("backend", backend, BACKENDS)
    most = limit("fail-beyond", fail_beyond)
    ladder.check()
    choices = methods.choices(algorithm)
    profile, words = ladder.profile()
    steps = listed("--steps", ladder.steps)

    import numpy as np

    from strapgen.experiments import convergence

    with np.errstate(all="ignore"):  # a step that is too long for a method is part of the picture
        runs = (convergence.converge(choice, profile, steps, ladder.duration, backend) for choice in choices)
        orders = list(track(runs, "running", len(choices)))
    _deliver(orders, f"{words}; {backend}", output)
    far = [order.kernel for order in orders if most is not None and not _within(order, most)]
    if far:
        typer.echo(
            f"strapgen: the observed order is off by more than {fail_beyond}: {', '.join(far)}", err=True
        )
        raise typer.Exit(1)


def _deliver(orders: list[Convergence], title: str, output: Output) -> None:
    from strapgen.reports.convergence import convergence_csv, convergence_text

    image = None
    if output.plot is not None:
        from strapgen.reports import plots

        image = plots.convergence_image(orders, title, output.plot)
    if output.format == "json":
        output.deliver(as_json([order.as_dict() for order in orders]), image)
    elif output.format == "csv":
        output.deliver(convergence_csv(orders), image)
    else:
        output.deliver(convergence_text(orders, title), image)


def _within(order: Convergence, limit: float) -> bool:
    """Tell whether the observed order is within the limit of the predicted one; False if either is missing."""
    return (
        order.observed is not None
        and order.predicted is not None
        and abs(order.observed - order.predicted) <= limit
    )
