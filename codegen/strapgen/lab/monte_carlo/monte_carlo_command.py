"""The command ``strapgen study monte-carlo`` runs an algorithm many times with the random errors of a gyro."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import STEP_OPTIONS, MethodOptions, StepAlgorithm, option
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.cli.progress import track
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.study.worker_options import WorkerOptions

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.lab.monte_carlo.random_runs import SteadyRuns

#: Most runs, and most steps of each.
_MOST = 10**9


@dataclass(frozen=True)
class RandomRunOptions:
    """Options of the gyro, of the turn and of the runs."""

    panel: ClassVar[str] = "Run"

    sample_hz: Annotated[
        str, option("--sample-hz", metavar="HZ", help="Sampling rate of the gyro in Hz.")
    ] = "100"
    rate: Annotated[
        str, option("--turn-deg-s", metavar="DEG_S", help="Rate of the steady turn about z in deg/s.")
    ] = "10"
    pulse: Annotated[
        str, option("--pulse-arcsec", metavar="ARCSEC", help="Angle of a pulse of the gyro; 0 for none.")
    ] = "0"
    noise: Annotated[
        str,
        option("--noise-deg-sqrt-h", metavar="N", help="Random walk of the gyro in deg per root of an hour."),
    ] = "0.01"
    runs: Annotated[str, option("--runs", metavar="N", help="Number of runs.")] = "1000"
    steps: Annotated[str, option("--length", metavar="N", help="Number of steps of each run.")] = "1000"
    of: Annotated[
        str,
        option("--of", metavar="N", help="Runs of the whole sweep, for which the time is extrapolated."),
    ] = "1000000"
    seed: Annotated[str, option("--seed", metavar="N", help="Where the random numbers begin.")] = "0"
    backend: Annotated[str, option("--backend", metavar="NAME", help="Back end: numpy or c.")] = "c"
    results: Annotated[
        Path | None,
        option(
            "--results",
            metavar="FILE",
            help="File that keeps each result when it is there; a sweep that was stopped goes on from it.",
        ),
    ] = None

    def sweep(self, choice: Choice) -> SteadyRuns:
        """Return the runs, checked."""
        from strapgen.lab.monte_carlo.random_runs import Errors, SteadyRuns

        checks.choice("backend", self.backend, ("numpy", "c"))
        if choice.increments is None:
            raise InputError(f"{choice.kernel} takes rates; a step that takes increments is needed")
        hertz = checks.number("sample-hz", self.sample_hz, positive=True)
        noise, pulse = (
            self._at_least_0("noise-deg-sqrt-h", self.noise),
            self._at_least_0("pulse-arcsec", self.pulse),
        )
        errors = Errors(
            math.radians(pulse / 3600),
            math.radians(noise) / 60 / math.sqrt(hertz),
            math.radians(float(checks.number("turn-deg-s", self.rate) / hertz)),
        )
        if not errors.pulse and not errors.noise:
            raise InputError("pulse-arcsec and noise-deg-sqrt-h are both 0; an error above 0 is needed")
        steps, runs = (
            checks.count(name, checks.whole(name, text), largest=_MOST)
            for name, text in (("length", self.steps), ("runs", self.runs))
        )
        seed = checks.count("seed", checks.whole("seed", self.seed), smallest=0, largest=_MOST)
        return SteadyRuns(choice, errors, steps, runs, (seed,), self.backend)

    def _at_least_0(self, name: str, text: str) -> float:
        number = checks.number(name, text)
        if number < 0:
            raise InputError(f"{name} is {text}; 0 for none, or a number above 0 is needed")
        return float(number)


@grouped
def study_monte_carlo(
    algorithm: StepAlgorithm,
    *,
    method: Annotated[MethodOptions, Shown(only=STEP_OPTIONS)],
    run: RandomRunOptions,
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
    jobs, cluster = workers.count(), workers.workers()
    whole = checks.count("of", checks.whole("of", run.of), largest=_MOST)
    sweep, hertz = run.sweep(method.choose(algorithm)), float(checks.number("sample-hz", run.sample_hz))
    from strapgen.lab.monte_carlo.random_runs import MeanSquare, cases, predicted, random_runs
    from strapgen.lab.monte_carlo.random_runs_report import RandomRunsResult
    from strapgen.run.backends import backend

    backend(sweep.algorithm, backend=sweep.backend)  # generated and compiled before the time counts
    resumed = run.results is not None and run.results.exists()
    begin = time.monotonic()
    parts = list(track(random_runs(sweep, run.results, jobs, cluster), "running", len(cases(sweep))))
    seconds = None if resumed else time.monotonic() - begin
    mean = predicted(sweep.algorithm, sweep.errors, sweep.steps)
    output.show(RandomRunsResult.of(sweep, MeanSquare.of(parts), mean, hertz, seconds, whole))
