"""What many runs with the random errors of a gyro drift by, and how long more runs take, as a result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from strapgen.lab.monte_carlo.random_runs import MeanSquare, SteadyRuns
from strapgen.results.result import Result

_HOUR = 3600


@dataclass(frozen=True)
class RandomRunsResult(Result):
    """The drift of many runs in a steady turn, beside that of the closed forms."""

    kernel: str
    backend: str
    #: Number of runs
    runs: int
    #: Steps of a run
    steps: int
    #: Length of a run in time of the gyro
    duration_s: float
    #: Root mean square of the drift at the end of the runs
    drift_deg_h: float
    #: Lower end of its interval of 95 %
    low_deg_h: float
    #: Upper end of that interval
    high_deg_h: float
    #: Root mean square of the drift by the closed forms
    predicted_deg_h: float
    #: Whether the prediction is in the interval
    inside: bool
    #: What the runs took; None if results of an earlier call are among them
    seconds: float | None
    #: Runs of a sweep for which the time is extrapolated
    sweep_runs: int
    #: Time that the sweep takes at the same pace
    sweep_hours: float | None

    @staticmethod
    def of(
        sweep: SteadyRuns,
        outcome: MeanSquare,
        predicted: float,
        sample_hz: float,
        seconds: float | None,
        whole: int,
    ) -> RandomRunsResult:
        """Return the result of runs: squared angles at their end in rad^2, measured and predicted."""
        duration = float(sweep.steps * sweep.algorithm.increments_per_step / sample_hz)
        low, high = outcome.interval()

        def drift(square: float) -> float:
            return math.degrees(math.sqrt(square)) / duration * _HOUR

        return RandomRunsResult(
            kernel=sweep.algorithm.kernel,
            backend=sweep.backend,
            runs=outcome.runs,
            steps=sweep.steps,
            duration_s=duration,
            drift_deg_h=drift(outcome.mean),
            low_deg_h=drift(low),
            high_deg_h=drift(high),
            predicted_deg_h=drift(predicted),
            inside=low <= predicted <= high,
            seconds=seconds,
            sweep_runs=whole,
            sweep_hours=None if seconds is None else seconds / outcome.runs * whole / _HOUR,
        )

    def rows(self) -> Sequence[dict[str, Any]]:
        """Return the result as one row."""
        return [self.as_dict() | {"inside": "yes" if self.inside else "no"}]

    def text(self) -> str:
        """Return the drift, its interval, the prediction and the time."""
        runs = f"{self.runs} runs of {self.steps} steps, {self.duration_s:g} s each"
        lines = [
            f"{runs}: {self.kernel}, {self.backend}",
            "",
            f"root mean square of the drift  {self.drift_deg_h:.4g} deg/h",
            f"95 % interval                  {self.low_deg_h:.4g} to {self.high_deg_h:.4g} deg/h",
            f"closed forms                   {self.predicted_deg_h:.4g} deg/h, "
            f"{'inside' if self.inside else 'outside'}",
        ]
        if self.seconds is not None:
            pace = f"{self.sweep_runs} runs take {self.sweep_hours:.3g} h at that pace"
            lines += ["", f"{self.seconds:.3g} s; {pace}"]
        return "\n".join(lines)
