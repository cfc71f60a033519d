"""The command ``strapgen converge`` measures the order of a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import (
    STEP_OPTIONS,
    Duration,
    SeveralBackends,
    SeveralMethods,
    StepAlgorithm,
    option,
)
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import NotNegative, Positive
from strapgen.lab.run_options import (
    MOTION_NAMES,
    MotionSettings,
    WorkerOptions,
    a_motion,
    in_words,
)

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.lab.convergence import Convergence, LadderCase

_Text = str | None


#: Steps in s
_STEPS = tuple(Positive(f"1/{2**halvings}") for halvings in range(1, 8))


@dataclass(frozen=True)
class _Ladder:
    """Options of the motion, the ladder of steps and the duration of the runs."""

    panel: ClassVar[str] = "Input"

    motion: Annotated[
        _Text,
        option(
            "--motion",
            metavar="NAME",
            help=f"Motion: {MOTION_NAMES}, or a Python file of your own.  [default: coning]",
            words="strapgen.catalogue:MOTIONS",
            read=a_motion,
        ),
    ] = None
    settings: MotionSettings = None
    steps: Annotated[
        tuple[Positive, ...],
        option(
            *("--step", "--steps"),
            metavar="S,...",
            help="Step lengths in s; each must divide the duration.",
        ),
    ] = _STEPS
    duration: Duration = Positive("2")

    @property
    def parameters(self) -> Mapping[str, str]:
        """The parameters of the motion."""
        from strapgen.lab.motions import motions

        return motions.GENERAL if self.motion is None and not self.settings else self.settings or {}

    def words(self) -> str:
        """Return a description of the runs, whose motion is checked."""
        from strapgen.lab.motions import users_motions

        profile = users_motions.any_motion(self.motion or "coning", self.duration, self.parameters)
        words = in_words(self.parameters)
        return f"{self.duration} s of {profile.name} motion" + (f", {words}" if words else "")

    def cases(self, choices: Sequence[Choice], names: Sequence[str]) -> list[LadderCase]:
        """Return a case for each algorithm on each back end."""
        from strapgen.lab.convergence import LadderCase

        motion, settings, steps = self.motion or "coning", dict(self.parameters), tuple(map(str, self.steps))
        return [
            LadderCase(choice, name, motion, settings, steps, str(self.duration))
            for choice in choices
            for name in names
        ]


@grouped
def converge(
    algorithm: StepAlgorithm,
    *,
    methods: Annotated[SeveralMethods, Shown(only=STEP_OPTIONS)],
    backend: SeveralBackends = ("exact",),
    ladder: _Ladder,
    fail_beyond: Annotated[
        NotNegative | None,
        option(
            "--fail-beyond",
            metavar="D",
            help="Exit with 1 if an observed order differs from the predicted one by more than D.",
            panel="Output",
        ),
    ] = None,
    workers: WorkerOptions,
    output: Output,
) -> None:
    """Measure the order of a step beside the predicted one.

    The order is the slope of the error on a ladder of step lengths. The back end exact computes with 40 digits and
    shows even high orders. Without --motion the runs are on a coning motion of about 1 rad/s with a steady rate added,
    so that the body turns about all axes.

    Example: strapgen converge euler --method rk1,rk2,rk4,butcher6 --increments enough --plot out/orders.png
    """
    output.check(algorithm, *methods.files)
    choices, cluster = methods.choices(algorithm), workers.workers()
    words, cases = ladder.words(), ladder.cases(choices, backend)

    from strapgen.lab import convergence
    from strapgen.lab.convergence_report import ConvergenceResult

    runs = track(convergence.converge_all(cases, workers.jobs, cluster), "running", len(cases))
    orders = [outcome for _, outcome in sorted(runs, key=lambda run: run[0])]
    output.show(ConvergenceResult(orders, f"{words}; {', '.join(backend)}"))
    if fail_beyond is not None and (
        far := [order.kernel for order in orders if not _within(order, fail_beyond)]
    ):
        typer.echo(
            f"strapgen: the observed order is off by more than {fail_beyond}: {', '.join(far)}", err=True
        )
        raise typer.Exit(1)


def _within(order: Convergence, limit: NotNegative) -> bool:
    """Return whether the observed order is near enough to the predicted one; False if either is missing."""
    return (
        order.observed is not None
        and order.predicted is not None
        and abs(order.observed - order.predicted) <= limit
    )
