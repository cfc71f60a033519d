"""The command ``strapgen study`` sweeps the settings of fixed point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import typer

from strapgen.cli.help import PlainCommand, PlainGroup
from strapgen.cli.option_groups import grouped
from strapgen.cli.options import Duration, Increments, listed, option, whole
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_files import is_file
from strapgen.lab.simulate.sample_source import MOTION_FILE, RUN_MOTION_NAMES, check_motion, pairs
from strapgen.lab.study.worker_options import WorkerOptions

app = typer.Typer(cls=PlainGroup, rich_markup_mode=None)


@app.callback()
def _group() -> None:
    """Run an algorithm with many settings, and show the drift."""


@dataclass(frozen=True)
class Sweep:
    """Options with lists of values; a study runs every combination of them."""

    panel: ClassVar[str] = "Sweep"

    methods: Annotated[
        str,
        option(
            *("--method", "--methods"),
            metavar="NAME,...",
            help="Integration methods, with commas between; strapgen list methods shows all.",
        ),
    ] = "rk4"
    increments: Increments = None
    words: Annotated[
        str, option(*("--word", "--words"), metavar="BITS,...", help="Word lengths in bits, 8 to 64.")
    ] = "8,10,12,14,16,18,20,24,28,32"
    roundings: Annotated[
        str,
        option(
            *("--rounding", "--roundings"),
            metavar="NAME,...",
            help="How results are rounded: nearest, truncation.",
        ),
    ] = "nearest"
    carries: Annotated[
        str,
        option(
            *("--carry", "--carries"),
            metavar="NAME,...",
            help="Error feedback from step to step: none, state, full.",
        ),
    ] = "none,state,full"
    steps: Annotated[
        str,
        option(
            *("--step", "--steps"),
            metavar="S,...",
            help="Step lengths in s; each must divide the duration.",
        ),
    ] = "0.125"
    pulses_arcsec: Annotated[
        str,
        option(
            *("--pulse-arcsec", "--pulses-arcsec"),
            metavar="ARCSEC,...",
            help="Angles of a gyro pulse in arc seconds; 0 for increments without pulses.",
        ),
    ] = "0"

    def values(self) -> dict[str, Any]:
        """Return the lists by the parameters of `word_length.cases`."""
        return {
            "methods": listed("--method", self.methods),
            "increments": whole("increments", self.increments) or 2,
            "words": [checks.whole("word", word) for word in listed("--word", self.words)],
            "roundings": listed("--rounding", self.roundings),
            "carries": listed("--carry", self.carries),
            "steps": listed("--step", self.steps),
            "pulses_arcsec": listed("--pulse-arcsec", self.pulses_arcsec),
        }


@app.command("word-length", cls=PlainCommand)
@grouped
def word_length(
    *,
    algorithm: Annotated[
        str,
        option(
            "--algorithm", metavar="NAME", help="Algorithm: dcm, euler or cayley-klein.", panel="Algorithm"
        ),
    ] = "euler",
    sweep: Sweep,
    motion: Annotated[
        str,
        option("--motion", metavar="NAME", help=f"Motion: {RUN_MOTION_NAMES}{MOTION_FILE}.", panel="Input"),
    ] = "coning",
    settings: Annotated[
        list[str] | None,
        option(
            "--set",
            metavar="KEY=VALUE...",
            help="Parameters of the motion; strapgen list motions shows their names.  "
            "[default: those of table 5 of the thesis]",
            panel="Input",
        ),
    ] = None,
    duration: Duration = "180",
    workers: WorkerOptions,
    output: Output,
) -> None:
    """Show the drift against the word length of fixed point.

    The integer model runs every combination of method, word, rounding, carry, step and gyro pulse on a motion with
    known attitude. You see the drift from the truth and its three parts: the rounding of the arithmetic, beside its
    certified bound; the rounding of the increments; and the truncation error of the method. Finished runs stay in the
    cache, so that a study that you stop goes on from there.

    Example: strapgen study word-length --word 12,16,20,24,32 --carry none,full --plot out/word-length.png
    """
    output.check(algorithm)
    from strapgen import catalogue

    checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)
    from strapgen.lab.motions.motion_names import MOTIONS

    check_motion(motion, MOTIONS)
    count, cluster = workers.count(), workers.workers()
    if settings is None and motion != "coning" and not is_file(motion):
        raise InputError(f"--motion {motion} needs --set; strapgen list motions shows the keys")

    import numpy as np

    from strapgen.lab.word_length.word_length import cases, run

    planned = cases(
        algorithm=algorithm,
        duration=duration,
        motion_name=motion,
        settings=None if settings is None else pairs(settings),
        **sweep.values(),
    )
    _ = planned[0].profile  # a motion that lacks a parameter is told before anything runs
    with np.errstate(all="ignore"):
        outcomes = {done.case: done for done in track(run(planned, count, cluster), "running", len(planned))}
    from strapgen.lab.word_length.word_length_report import WordLengthResult

    output.show(WordLengthResult([outcomes[case] for case in planned]))
