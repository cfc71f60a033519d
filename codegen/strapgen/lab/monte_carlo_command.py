"""The command ``strapgen study monte-carlo`` runs an algorithm many times with the random errors of a gyro."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, GyroRate, MethodOptions, StepAlgorithm, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.progress import track
from strapgen.cli.values import NotNegative, Number, Positive, names, whole
from strapgen.ir.exceptions import InputError
from strapgen.lab.run_options import WorkerOptions

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.lab.random_runs import SteadyRuns

#: Reads a number of runs, or of steps of each.
_A_COUNT = whole(1, 10**9)


@dataclass(frozen=True)
class _RandomRunOptions:
    """Options of the gyro, of the turn and of the runs."""

    panel: ClassVar[str] = "Run"

    sample_hz: GyroRate = Positive("100")
    rate: Annotated[
        Number, option("--turn-deg-s", metavar="DEG_S", help="Rate of the steady turn about z in deg/s.")
    ] = Number("10")
    pulse: Annotated[
        NotNegative,
        option("--pulse-arcsec", metavar="ARCSEC", help="Angle of a pulse of the gyro; 0 for none."),
    ] = NotNegative("0")
    noise: Annotated[
        NotNegative,
        option("--noise-deg-sqrt-h", metavar="N", help="Random walk of the gyro in deg per root of an hour."),
    ] = NotNegative("0.01")
    runs: Annotated[int, option("--runs", metavar="N", help="Number of runs.", read=_A_COUNT)] = 1000
    steps: Annotated[
        int, option("--length", metavar="N", help="Number of steps of each run.", read=_A_COUNT)
    ] = 1000
    of: Annotated[
        int,
        option(
            "--of",
            metavar="N",
            help="Runs of the whole sweep, for which the time is extrapolated.",
            read=_A_COUNT,
        ),
    ] = 1_000_000
    seed: Annotated[
        int, option("--seed", metavar="N", help="Seed of the random numbers.", read=whole(0, 10**9))
    ] = 0
    backend: Annotated[
        str,
        option("--backend", metavar="NAME", help="Back end: numpy or c.", read=names(("numpy", "c"))),
    ] = "c"
    results: Annotated[
        Path | None,
        option(
            "--results",
            metavar="FILE",
            help="File for the results of finished cases, from which an interrupted sweep resumes.",
        ),
    ] = None

    def sweep(self, choice: Choice) -> SteadyRuns:
        """Return the runs, checked."""
        from strapgen.lab.random_runs import Errors, SteadyRuns

        if choice.increments is None:
            raise InputError(f"{choice.kernel} takes rates; a step that takes increments is needed")
        errors = Errors(
            math.radians(float(self.pulse) / 3600),
            math.radians(float(self.noise)) / 60 / math.sqrt(self.sample_hz),
            math.radians(float(self.rate / self.sample_hz)),
        )
        if not errors.pulse and not errors.noise:
            raise InputError("pulse-arcsec and noise-deg-sqrt-h are both 0; an error above 0 is needed")
        return SteadyRuns(choice, errors, self.steps, self.runs, (self.seed,), self.backend)


@grouped
def study_monte_carlo(
    algorithm: StepAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    run: _RandomRunOptions,
    workers: WorkerOptions,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Run an algorithm many times in a steady turn, with pulses and noise of a gyro.

    You see the root mean square of the drift with its 95 % interval, beside that of the closed forms, the time that
    the runs took, and how long a sweep of more runs takes. Each run has random numbers of its own, so that the drift
    does not depend on the number of processes or of workers of a cluster.

    Example: strapgen study monte-carlo euler --runs 500 --length 200

    Example: strapgen study monte-carlo euler --method coning-combined --increments 3 --pulse-arcsec 5 --runs 500
    --length 200 --jobs 2
    """
    output.check(algorithm, run.results, *method.files)
    if run.results is not None and output.file is not None and run.results.resolve() == output.file.resolve():
        raise InputError(f"--out and --results are both {run.results}; two files are needed")
    cluster, sweep = workers.workers(), run.sweep(method.choose(algorithm))
    from strapgen.lab.random_runs import MeanSquare, RandomRunsResult, cases, predicted, random_runs
    from strapgen.run.backends import backend

    backend(sweep.algorithm, backend=sweep.backend)  # generated and compiled before the time counts
    resumed = run.results is not None and run.results.exists()
    begin = time.monotonic()
    parts = list(track(random_runs(sweep, run.results, workers.jobs, cluster), "running", len(cases(sweep))))
    seconds = None if resumed else time.monotonic() - begin
    mean = predicted(sweep.algorithm, sweep.errors, sweep.steps)
    figures = (MeanSquare.of(parts), mean, float(run.sample_hz), seconds, run.of)
    output.show(RandomRunsResult.of(sweep, *figures))
