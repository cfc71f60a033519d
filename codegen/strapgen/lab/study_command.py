"""The command ``strapgen study`` sweeps the settings of fixed point."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, ClassVar

import typer

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import Duration, StepName, option
from strapgen.cli.output import Output
from strapgen.cli.program import PlainCommand, PlainGroup
from strapgen.cli.progress import track
from strapgen.cli.values import NotNegative, Positive
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.run_options import MOTION_SETTINGS, WorkerOptions, motion_option

app = typer.Typer(cls=PlainGroup, rich_markup_mode=None)


@app.callback()
def _group() -> None:
    """Run an algorithm with many settings, and show the drift."""


@dataclass(frozen=True)
class _Sweep:
    """Options with lists of values; a study runs every combination of them."""

    panel: ClassVar[str] = "Sweep"

    methods: Annotated[
        tuple[str, ...],
        option(
            *("--method", "--methods"),
            metavar="NAME,...",
            help="Integration methods, with commas between; strapgen list methods shows all.",
        ),
    ] = ("rk4",)
    increments: Annotated[
        int | None,
        option(
            "--increments", metavar="N", help="Number of angle increments in a step, 1 to 8.  [default: 2]"
        ),
    ] = None
    words: Annotated[
        tuple[int, ...],
        option(*("--word", "--words"), metavar="BITS,...", help="Word lengths in bits, 8 to 64."),
    ] = (8, 10, 12, 14, 16, 18, 20, 24, 28, 32)
    roundings: Annotated[
        tuple[str, ...],
        option(
            *("--rounding", "--roundings"),
            metavar="NAME,...",
            help="How results are rounded: nearest, truncation.",
        ),
    ] = ("nearest",)
    carries: Annotated[
        tuple[str, ...],
        option(
            *("--carry", "--carries"),
            metavar="NAME,...",
            help="Error feedback from step to step: none, state, full.",
        ),
    ] = ("none", "state", "full")
    steps: Annotated[
        tuple[Positive, ...],
        option(
            *("--step", "--steps"),
            metavar="S,...",
            help="Step lengths in s; each must divide the duration.",
        ),
    ] = (Positive("0.125"),)
    pulses_arcsec: Annotated[
        tuple[NotNegative, ...],
        option(
            *("--pulse-arcsec", "--pulses-arcsec"),
            metavar="ARCSEC,...",
            help="Angles of a gyro pulse in arc seconds; 0 for increments without pulses.",
        ),
    ] = (NotNegative("0"),)


@app.command("word-length", cls=PlainCommand)
@grouped
def word_length(
    *,
    algorithm: StepName = "euler",
    sweep: _Sweep,
    motion: Annotated[str, motion_option()] = "coning",
    settings: Annotated[
        dict[str, str] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the motion; strapgen list motions shows their names.  "
            "[default: those of table 5 of the thesis]",
            panel="Input",
            words=MOTION_SETTINGS,
        ),
    ] = None,
    duration: Duration = Positive("180"),
    workers: WorkerOptions,
    output: Output,
) -> None:
    """Show the drift against the word length of fixed point.

    The integer model runs every combination of method, word, rounding, carry, step and gyro pulse on a motion with
    known attitude. You see the drift from the truth and its three parts: the rounding of the arithmetic, beside its
    certified bound; the rounding of the increments; and the truncation error of the method. Finished runs stay in the
    cache, from which an interrupted study resumes.

    Example: strapgen study word-length --word 12,16,20,24,32 --carry none,full --plot out/word-length.png
    """
    output.check(algorithm)
    cluster = workers.workers()
    if settings is None and motion != "coning" and not is_file(motion):
        raise InputError(f"--motion {motion} needs --set; strapgen list motions shows the keys")

    import numpy as np

    from strapgen.lab.word_length import cases, run

    planned = cases(
        algorithm=algorithm,
        duration=duration,
        motion_name=motion,
        settings=settings,
        **asdict(sweep) | {"increments": sweep.increments or 2},
    )
    _ = planned[0].profile  # a motion that lacks a parameter is told before anything runs
    with np.errstate(all="ignore"):
        outcomes = {
            done.case: done for done in track(run(planned, workers.jobs, cluster), "running", len(planned))
        }
    from strapgen.lab.word_length_report import WordLengthResult

    output.show(WordLengthResult([outcomes[case] for case in planned]))
