"""The command ``strapgen study`` sweeps the settings of fixed point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import Increments, listed, whole
from strapgen.cli.output import Output, as_json
from strapgen.cli.progress import track
from strapgen.cli.sample_source import pairs
from strapgen.support import checks
from strapgen.support.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.experiments.word_length import Outcome

app = typer.Typer(
    help="Run an algorithm with many settings, and see how they change the drift.", rich_markup_mode=None
)


@app.callback()
def _group() -> None:
    """Run an algorithm with many settings, and see how they change the drift."""


@dataclass(frozen=True)
class Sweep:
    """Options with lists of values; a study runs every combination of them."""

    methods: Annotated[str, typer.Option("--methods", metavar="NAME,...", help="Integration methods.")] = (
        "rk4"
    )
    increments: Increments = None
    words: Annotated[
        str, typer.Option("--words", metavar="BITS,...", help="Word lengths in bits, 8 to 64.")
    ] = "8,10,12,14,16,18,20,24,28,32"
    roundings: Annotated[
        str, typer.Option("--roundings", metavar="NAME,...", help="Roundings: nearest, truncation.")
    ] = "nearest"
    carries: Annotated[
        str,
        typer.Option(
            "--carries",
            metavar="NAME,...",
            help="Error feedback from step to step: none, state, full.",
        ),
    ] = "none,state,full"
    steps: Annotated[str, typer.Option("--steps", metavar="S,...", help="Step lengths in s.")] = "0.125"
    pulses_arcsec: Annotated[
        str,
        typer.Option(
            "--pulses-arcsec",
            metavar="ANGLE,...",
            help="Angles of a gyro pulse in arc seconds; 0 for increments without pulses.",
        ),
    ] = "0"

    def values(self) -> dict[str, Any]:
        """Return the lists by the parameters of `word_length.cases`."""
        return {
            "methods": listed("--methods", self.methods),
            "increments": whole("increments", self.increments) or 2,
            "words": [checks.whole("words", word) for word in listed("--words", self.words)],
            "roundings": listed("--roundings", self.roundings),
            "carries": listed("--carries", self.carries),
            "steps": listed("--steps", self.steps),
            "pulses_arcsec": listed("--pulses-arcsec", self.pulses_arcsec),
        }


@app.command("word-length")
@grouped
def word_length(
    *,
    algorithm: Annotated[
        str, typer.Option("--algorithm", help="Algorithm: dcm, euler or cayley-klein.")
    ] = "euler",
    sweep: Sweep,
    motion: Annotated[
        str, typer.Option("--motion", help="Motion to run on: constant, sinusoidal, coning or polynomial.")
    ] = "coning",
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the motion.  [default: those of table 5 of the thesis]",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[
        str, typer.Option("--duration", metavar="S", help="Duration of each run in s.")
    ] = "180",
    jobs: Annotated[
        str | None,
        typer.Option(
            "--jobs",
            metavar="N",
            help="Number of processes that run side by side.  [default: one for each processor]",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Output, Shown(only=("plot", "out", "format"))],
) -> None:
    """Show the drift against word length, for every combination of word, rounding, carry, step, method and gyro pulse.

    The integer model runs each combination on a motion with known attitude. You see the drift from the truth and its
    three parts: the rounding of the arithmetic, beside its certified bound; the rounding of the increments; and the
    truncation error of the method. Finished runs stay in the cache, so that a study that you stop goes on from there.

    Example:

    \b
      strapgen study word-length --words 12,16,20,24,32 \\
        --carries none,full --plot out/word-length.png
    """  # noqa: D301
    output.check(algorithm)
    from strapgen import catalogue

    checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)
    checks.choice("motion", motion, catalogue.MOTIONS)
    for name in listed("--methods", sweep.methods):
        catalogue.choose(algorithm, name, whole("increments", sweep.increments))
    count = whole("jobs", jobs)
    if count is not None:
        checks.count("jobs", count, largest=1024)
    if settings is None and motion != "coning":
        raise InputError(f"--motion {motion} needs --set; strapgen list shows the keys")

    import numpy as np

    from strapgen.experiments.word_length import cases, run

    planned = cases(
        algorithm=algorithm,
        duration=duration,
        motion_name=motion,
        settings=None if settings is None else pairs(settings),
        **sweep.values(),
    )
    _ = planned[0].profile  # a motion that lacks a parameter is told before anything runs
    with np.errstate(all="ignore"):
        outcomes = {done.case: done for done in track(run(planned, count), "running", len(planned))}
    _deliver([outcomes[case] for case in planned], output)


def _deliver(outcomes: list[Outcome], output: Output) -> None:
    from strapgen.reports.word_length import word_length_csv, word_length_text

    image = None
    if output.plot is not None:
        from strapgen.reports import plots

        image = plots.word_length_image(outcomes, output.plot)
    if output.format == "json":
        output.deliver(as_json([outcome.as_dict() for outcome in outcomes]), image)
    elif output.format == "csv":
        output.deliver(word_length_csv(outcomes), image)
    else:
        output.deliver(word_length_text(outcomes), image)
