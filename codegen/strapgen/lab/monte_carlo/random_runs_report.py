"""Reports what many runs with the random errors of a gyro drift by, and how long more runs take."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from strapgen.lab.monte_carlo.random_runs import MeanSquare, SteadyRuns
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_HOUR = 3600


@dataclass(frozen=True)
class RandomStudy:
    """The outcome of many runs."""

    runs: SteadyRuns
    #: The squared angle at the end of the runs
    outcome: MeanSquare
    #: Its mean by the closed forms, in rad^2
    predicted: float
    #: Sampling rate in Hz
    sample_hz: float
    #: What the runs took; None if results of an earlier call are among them
    seconds: float | None
    #: Runs of a sweep for which the time is extrapolated
    whole: int

    @property
    def duration(self) -> float:
        """Length of a run in s of the gyro's time."""
        return float(self.runs.steps * self.runs.algorithm.increments_per_step / self.sample_hz)

    def drift(self, square: float) -> float:
        """Return the drift in deg/h of a squared angle at the end of a run."""
        return math.degrees(math.sqrt(square)) / self.duration * _HOUR

    def as_dict(self) -> dict[str, Any]:
        """Return the outcome as plain JSON data."""
        low, high = self.outcome.interval()
        return {
            "kernel": self.runs.algorithm.kernel,
            "backend": self.runs.backend,
            "runs": self.outcome.runs,
            "steps": self.runs.steps,
            "duration_s": self.duration,
            "drift_deg_h": self.drift(self.outcome.mean),
            "low_deg_h": self.drift(low),
            "high_deg_h": self.drift(high),
            "predicted_deg_h": self.drift(self.predicted),
            "inside": low <= self.predicted <= high,
            "seconds": self.seconds,
            "sweep_runs": self.whole,
            "sweep_hours": self.hours,
        }

    @property
    def hours(self) -> float | None:
        """Hours that the whole sweep takes at the same pace."""
        return None if self.seconds is None else self.seconds / self.outcome.runs * self.whole / _HOUR


def random_report(study: RandomStudy) -> Report:
    """Return the drift of many runs as a report."""
    return Report(lambda: _text(study), study.as_dict, lambda: _table(study))


def _table(study: RandomStudy) -> TextTable:
    data = study.as_dict()
    data["inside"] = "yes" if data["inside"] else "no"
    texts = ("kernel", "backend", "inside")
    return TextTable(
        [Column(name, "<" if name in texts else ">", missing="") for name in data], [[*data.values()]]
    )


def _text(study: RandomStudy) -> str:
    """Return the outcome for a reader."""
    data = study.as_dict()
    lines = [
        f"{data['runs']} runs of {data['steps']} steps, {study.duration:g} s each: {data['kernel']}, {data['backend']}",
        "",
        f"root mean square of the drift  {data['drift_deg_h']:.4g} deg/h",
        f"95 % interval                  {data['low_deg_h']:.4g} to {data['high_deg_h']:.4g} deg/h",
        f"closed forms                   {data['predicted_deg_h']:.4g} deg/h, "
        f"{'inside' if data['inside'] else 'outside'}",
    ]
    if study.seconds is not None and study.hours is not None:
        lines += ["", f"{study.seconds:.3g} s; {study.whole} runs take {study.hours:.3g} h at that pace"]
    return "\n".join(lines)
