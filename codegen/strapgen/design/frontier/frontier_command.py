"""The command ``strapgen frontier`` compares the drift of algorithms on many motions with what they cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import Needs, grouped, rules
from strapgen.cli.options import Duration, GyroRate, option
from strapgen.cli.output import Output
from strapgen.cli.values import Positive
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.run_options import (
    MotionSettings,
    WorkerOptions,
    motion_option,
)

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class StudyRun:
    """Options of the runs of a study."""

    panel: ClassVar[str] = "Run"

    sample_hz: GyroRate = Positive("100")
    duration: Duration = Positive("60")
    results: Annotated[
        Path | None,
        option(
            "--results",
            metavar="FILE",
            help="File that keeps each result when it is there; a study that was stopped goes on from it.",
        ),
    ] = None

    def check(self, output: Output) -> None:
        """Check that the output is not written over the results."""
        for name, path in (("--out", output.file), ("--plot", output.plot)):
            if path is not None and self.results is not None and path.resolve() == self.results.resolve():
                raise InputError(f"{name} and --results are both {path}; two files are needed")


@grouped
@rules(Needs("--set", "--motion"))
def frontier(
    *,
    methods: Annotated[
        tuple[str, ...] | None,
        option(
            *("--method", "--methods"),
            metavar="NAME,...",
            help="Methods, each with all of its samples or one choice of them, as in magnus6:3 or "
            "coning-combined:8+3; all: every method.  [default: those of the catalogue and of the literature]",
            panel="Algorithm",
        ),
    ] = None,
    motion: Annotated[str | None, motion_option("cones, random rates and slews")] = None,
    settings: MotionSettings = None,
    run: StudyRun,
    workers: WorkerOptions,
    output: Output,
) -> None:
    """Compare the drift of algorithms on many motions with their cost.

    All algorithms get the same samples, of cones, cones on a spinning body, random rates, and slews with soft and with
    sharp onsets. You see the largest angle from the true attitude, divided by the duration, beside the multiplications
    and additions for each sample. The plot shows which algorithms halve the drift of all that cost less.

    With --motion they run on that motion alone.

    A method:N+P+L takes N samples in a step, P from before it and L from after it. The method fit-exact integrates the
    polynomial through its samples exactly, as iterations on it do in the limit.

    Example: strapgen frontier --method coning-compressed:1+1,coning-combined:3+3 --duration 6

    Example: strapgen frontier --method coning-least-squares,window-7-7 --duration 6 --results out/frontier.jsonl --plot
    out/frontier.png
    """
    output.check(run.results, motion if motion and is_file(motion) else None)
    run.check(output)
    from strapgen.cli.progress import track
    from strapgen.design.frontier import frontier as study

    motions = study.MOTIONS if motion is None else {motion: (motion, settings or {})}
    rates, cluster = (str(run.sample_hz), str(run.duration)), workers.workers()
    several = study.candidates(methods)
    runs = study.frontier(several, *rates, run.results, workers.jobs, cluster, motions)
    standings = study.in_order(track(runs, "running", len(several)), several)
    from strapgen.design.frontier.frontier_report import FrontierResult

    output.show(FrontierResult(standings, float(run.sample_hz), float(run.duration), motions))
