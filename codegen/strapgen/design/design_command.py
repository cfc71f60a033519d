"""The commands ``strapgen design``, to answer a brief, and ``frontier``, to compare drift with cost."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import typer

from strapgen.cli import terminal
from strapgen.cli.option_groups import Needs, grouped, rules
from strapgen.cli.options import Duration, GyroRate, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track, waiting
from strapgen.cli.values import Positive, whole
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.run_options import MotionSettings, SensorFile, WorkerOptions, motion_option

if TYPE_CHECKING:
    from strapgen.design.brief import DesignBrief
    from strapgen.design.selection.judgement import Judgement
    from strapgen.design.selection.simulated import Simulated


@grouped
def design(
    file: Annotated[
        Path, typer.Argument(metavar="BRIEF", help="TOML file with the brief.", show_default=False)
    ],
    *,
    methods: Annotated[
        tuple[str, ...] | None,
        option(
            *("--method", "--methods"),
            metavar="NAME,...",
            help="Compare these methods only, with all numbers of samples or some, as magnus4 or coning-combined:3+3.  "
            "[default: all of the catalogue, and what is designed for the brief]",
            panel="Algorithm",
        ),
    ] = None,
    simulate: Annotated[
        int | None,
        option(
            "--simulate",
            metavar="N",
            help="Simulate the cheapest N algorithms, and show their drift beside the predicted one.",
            panel="Run",
            read=whole(1),
        ),
    ] = None,
    generate: Annotated[
        Path | None,
        option(
            "--generate",
            metavar="FOLDER",
            help="Write the fixed-point C of the cheapest algorithm, its project and test, and a report.",
            panel="Run",
        ),
    ] = None,
    results: Annotated[
        Path | None,
        option(
            "--results",
            metavar="FILE",
            help="File for the results of finished cases, from which an interrupted run resumes.",
            panel="Run",
        ),
    ] = None,
    workers: WorkerOptions,
    output: Output,
) -> None:
    """Select the cheapest algorithm that meets a brief.

    The brief states the largest rate, the vibration, the gyro, the budget and the processor. You see every algorithm
    of the catalogue, and coefficients and filters designed for the vibration and the gyro, with its predicted drift by
    cause, its cost, and the limit that excludes it if it does not meet the brief. The bound of rounding is certified.

    Example: strapgen design examples/briefs/ahrs.toml --plot out/ahrs.png

    Example: strapgen design examples/briefs/ahrs.toml --simulate 5 --generate out/ahrs
    """
    output.check(file, results)
    _check_results(results, output)
    count, cluster = workers.jobs, workers.workers()
    from strapgen.design.brief import read_brief
    from strapgen.design.selection.candidates import contenders
    from strapgen.design.selection.judgement import in_order, judgements
    from strapgen.design.selection.selection_report import SelectionResult
    from strapgen.design.selection.simulated import confirm

    brief = read_brief(file)
    several = contenders(brief, methods)
    rows = track(judgements(file, several, results, count, cluster), "judging", len(several))
    judged = in_order(one for row in rows for one in row)
    with waiting("running the answer"):
        ordered = confirm(brief, file, judged)
    runs = None if simulate is None else _simulate(brief, file, ordered[:simulate], count)
    result = SelectionResult(brief, ordered, runs, file.stem)
    if generate is not None:
        _write(brief, file, ordered, generate, result.text())
    output.show(result)


def _check_results(results: Path | None, output: Output) -> None:
    """Refuse an output that would be written over the results."""
    for name, path in (("--out", output.file), ("--plot", output.plot)):
        if path is not None and results is not None and path.resolve() == results.resolve():
            raise InputError(f"{name} and --results are both {path}; two files are needed")


def _simulate(
    brief: DesignBrief, file: Path, ordered: list[Judgement], jobs: int | None
) -> dict[str, Simulated]:
    """Return time simulations of the algorithms that meet the brief, and of those that do not because of their runs."""
    from strapgen.design.selection.simulated import algorithm_named, run

    accepted = [one for one in ordered if one.meets or one.run_deg_h is not None]
    steps = ((one.name, run(brief, one, algorithm_named(one, brief, file), jobs)) for one in accepted)
    return dict(track(steps, "running", len(accepted)))


def _write(brief: DesignBrief, file: Path, ordered: list[Judgement], folder: Path, report: str) -> None:
    """Write the firmware of the cheapest algorithm that meets the brief."""
    from strapgen.cli.generate_command import SourceOptions
    from strapgen.design.selection.selection_report import firmware_files
    from strapgen.design.selection.simulated import algorithm_named

    if not ordered or not ordered[0].meets:
        raise InputError(f"{file}: no algorithm meets the brief, so --generate has nothing to write")
    best = ordered[0]
    files = firmware_files(
        brief, best, algorithm_named(best, brief, file), report, f"strapgen design {shlex.quote(str(file))}"
    )
    for path in SourceOptions(out=folder).write(files):
        terminal.remark(f"wrote {path}")


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
            help="File for the results of finished cases, from which an interrupted study resumes.",
        ),
    ] = None


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
    errors: SensorFile = None,
    run: StudyRun,
    workers: WorkerOptions,
    output: Output,
) -> None:
    """Compare the drift of algorithms on many motions with their cost.

    All algorithms get the same samples, of cones, cones on a spinning body, random rates, and slews with soft and with
    sharp onsets. You see the largest angle from the true attitude, divided by the duration, beside the multiplications
    and additions for each sample. The plot marks the algorithms that halve the drift of all cheaper ones.

    With --motion the algorithms run on that motion only. With --errors the samples are those of sensors with errors,
    and the drift is the steady one: between the means of the first and the last tenth, of some runs.

    A method:N+P+L takes N samples in a step, P from before it and L from after it. The method fit-exact integrates the
    polynomial through its samples exactly, as iterations on it do in the limit.

    Example: strapgen frontier --method coning-compressed:1+1,coning-combined:3+3 --duration 6

    Example: strapgen frontier --method coning-least-squares,window-7-7 --duration 6 --results out/frontier.jsonl --plot
    out/frontier.png
    """
    output.check(run.results, motion if motion and is_file(motion) else None, errors)
    _check_results(run.results, output)
    from strapgen.cli.progress import track
    from strapgen.design import frontier as study

    motions = study.MOTIONS if motion is None else {motion: (motion, settings or {})}
    rates, cluster = (str(run.sample_hz), str(run.duration)), workers.workers()
    several = study.candidates(methods)
    runs = study.frontier(several, *rates, run.results, workers.jobs, cluster, motions, errors or "")
    drifts_and_costs = study.in_order(track(runs, "running", len(several)), several)
    from strapgen.design.frontier import FrontierResult

    output.show(
        FrontierResult(drifts_and_costs, float(run.sample_hz), float(run.duration), motions, errors or "")
    )
