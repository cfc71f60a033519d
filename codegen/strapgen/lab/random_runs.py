"""Runs an algorithm many times in a steady turn, with pulses and noise of a gyro, and squares the angles they leave.

Runs are worked out in cases of some hundred, each with random numbers of its own, so that the outcome does not depend
on how many processes work on them, or which of them ends first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import Choice
from strapgen.ir.version import VERSION
from strapgen.lab.parallel_cases import Cluster, resume, side_by_side
from strapgen.lab.quantization_noise import quantization_noise
from strapgen.lab.runs import drift_between
from strapgen.results.result import Result
from strapgen.run.backends import backend
from strapgen.storage import cache as disk_cache

Array = NDArray[np.float64]

#: Runs of a case, and numbers that are drawn at a time.
_RUNS_OF_CASE, _DRAWN = 250, 1 << 21
#: Half the width of a 95 % interval in standard deviations.
_WIDTH = 1.96
_AXES = 3

_HOUR = 3600


@dataclass(frozen=True)
class Errors:
    """Errors of the increments of a gyro, and the steady turn of the runs."""

    #: Angle of a pulse in rad. The errors of the angles of two samples have nothing to do with each other
    pulse: float
    #: Standard deviation of each increment in rad
    noise: float
    #: Angle in rad by which the body turns about z from sample to sample
    turn: float


@dataclass(frozen=True)
class SteadyRuns:
    """Some runs of an algorithm in a steady turn, with random errors of their own."""

    #: A choice of an attitude step; or another algorithm, whose method `runner` returns what has `propagate` and
    #: `matrices` of a back end
    algorithm: Any
    errors: Errors
    #: Steps of each run
    steps: int
    #: Number of runs
    runs: int
    #: Seed of the random numbers
    seed: tuple[int, ...] = (0,)
    #: A key of `strapgen.run.backends.BACKENDS`
    backend: str = "numpy"


@dataclass(frozen=True)
class MeanSquare:
    """The mean square of the angle at the end of random runs, in rad^2."""

    runs: int = 0
    #: Sum of the squared angles, and of their squares
    total: float = 0.0
    squares: float = 0.0

    @classmethod
    def of(cls, parts: Iterable[MeanSquare]) -> MeanSquare:
        """Return the mean square of several parts together, whose order changes nothing.

        >>> MeanSquare.of([MeanSquare(1, 0.1, 0.01), MeanSquare(1, 0.3, 0.09)]).mean
        0.2
        """
        several = list(parts)
        totals, squares = ([getattr(one, name) for one in several] for name in ("total", "squares"))
        return cls(sum(one.runs for one in several), math.fsum(totals), math.fsum(squares))

    @property
    def mean(self) -> float:
        """The mean of the squared angles."""
        return self.total / self.runs

    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the mean, from the spread of the runs.

        >>> low, high = MeanSquare(10_000, 10_000.0, 20_000.0).interval()
        >>> round(low, 4), round(high, 4)
        (0.9804, 1.0196)
        """
        variance = max(0.0, self.squares / self.runs - self.mean**2)
        width = _WIDTH * math.sqrt(variance / self.runs)
        return max(0.0, self.mean - width), self.mean + width


def predicted(choice: Choice, errors: Errors, steps: int) -> float:
    """Return the mean square of the angle after some steps in rad^2, from the closed forms."""
    count = choice.increments_per_step
    total = _AXES * errors.noise**2 * steps * count
    if errors.pulse:
        turned = steps * (errors.turn * count) ** 2
        total += quantization_noise(choice).mean_square(errors.pulse, turned, steps)
    return total


def random_runs(
    runs: SteadyRuns,
    results: str | Path | None = None,
    jobs: int | None = None,
    cluster: Cluster | None = None,
) -> Iterator[MeanSquare]:
    """Run, and yield the mean square of each part as it is finished."""
    parts = cases(runs)
    if results is None:
        finished = side_by_side(mean_square, parts, jobs, cluster)
    else:
        finished = resume(mean_square, parts, results, _identity(runs), jobs, cluster)
    for _, outcome in finished:
        yield MeanSquare(**outcome)


def cases(runs: SteadyRuns) -> dict[str, SteadyRuns]:
    """Return runs in parts of at most some hundred, by their names.

    >>> [part.runs for part in cases(SteadyRuns(Choice("euler", "rk4", 2), Errors(0, 1e-6, 0), 10, 600)).values()]
    [250, 250, 100]
    """
    starts = range(0, runs.runs, _RUNS_OF_CASE)
    return {
        f"runs {start + 1} to {min(start + _RUNS_OF_CASE, runs.runs)}": replace(
            runs, runs=min(_RUNS_OF_CASE, runs.runs - start), seed=(*runs.seed, number)
        )
        for number, start in enumerate(starts)
    }


def _identity(runs: SteadyRuns) -> dict[str, Any]:
    """Return the identity of results, without the number of runs, so that more can be added."""
    return {
        "study": "monte-carlo",
        "version": VERSION,
        "code": disk_cache.generator_digest(),
        "algorithm": runs.algorithm.identity,
        "errors": asdict(runs.errors),
        "steps": runs.steps,
        "seed": list(runs.seed),
        "backend": runs.backend,
    }


def mean_square(runs: SteadyRuns) -> dict[str, Any]:
    """Return the mean square of some runs as plain JSON data, see `MeanSquare`."""
    algorithm = runs.algorithm
    step = _runner(algorithm, runs.backend)
    count, beside = algorithm.increments, algorithm.previous + algorithm.ahead
    block = max(1, _DRAWN // (runs.runs * count * _AXES))
    drawn = _Gyro(runs, beside)
    states: Any = None
    for steps in _blocks(runs.steps, block):
        states = _ends(step, _windows(drawn.rows(steps * count), count, beside), states)
    true = _error_free(algorithm, runs.backend, runs.errors.turn, runs.steps, block)
    angles = np.square(drift_between(step.matrices(states), true)).sum(axis=-1)
    return asdict(MeanSquare(runs.runs, float(angles.sum()), float(np.square(angles).sum())))


@lru_cache(maxsize=4)
def _error_free(algorithm: Any, backend_name: str, turn: float, steps: int, block: int) -> Array:
    """Return the attitude at the end of a run without errors as a matrix, the same for all parts of a study."""
    step = _runner(algorithm, backend_name)
    count, beside = algorithm.increments, algorithm.previous + algorithm.ahead
    states: Any = None
    for some in _blocks(steps, block):
        turning = np.zeros((1, some * count + beside, _AXES))
        turning[..., 2] = turn
        states = _ends(step, _windows(turning, count, beside), states)
    matrices: Array = step.matrices(states)
    return matrices


def _runner(algorithm: Any, backend_name: str) -> Any:
    """Return the object with `propagate` and `matrices`."""
    return backend(algorithm, backend=backend_name) if isinstance(algorithm, Choice) else algorithm.runner()


def _blocks(steps: int, block: int) -> list[int]:
    """Return the numbers of steps that are run at a time."""
    return [min(block, steps - first) for first in range(0, steps, block)]


class _Gyro:
    """Draws the increments of runs part by part; those from beside a step begin before the run and end after it."""

    def __init__(self, runs: SteadyRuns, beside: int) -> None:
        self._runs = runs
        self._random = np.random.default_rng(np.random.SeedSequence(runs.seed))
        self._before = runs.algorithm.previous
        self._angle = self._rounded(1)
        if not self._before:
            self._angle[:] = 0.0  # the first angle of a run is exact
        self._last = np.zeros((runs.runs, 0, _AXES))
        self._beside = beside

    def rows(self, samples: int) -> Array:
        """Return the next increments with those from beside the steps, (runs, samples + beside, 3)."""
        more = samples + self._beside - self._last.shape[1]
        angles = np.concatenate([self._angle, self._rounded(more)], axis=1)
        if self._before:  # the angle at the beginning of the run
            angles[:, self._before] = 0.0
            self._before = 0
        self._angle = angles[:, -1:]
        fresh = np.diff(angles, axis=1)
        if self._runs.errors.noise:
            fresh += self._random.normal(scale=self._runs.errors.noise, size=fresh.shape)
        fresh[..., 2] += self._runs.errors.turn
        rows: Array = np.concatenate([self._last, fresh], axis=1)
        self._last = rows[:, samples:]
        return rows

    def _rounded(self, samples: int) -> Array:
        """Return the errors of angles that are whole numbers of pulses."""
        shape = self._runs.runs, samples, _AXES
        pulse = self._runs.errors.pulse
        return self._random.uniform(-pulse / 2, pulse / 2, shape) if pulse else np.zeros(shape)


def _windows(rows: Array, count: int, beside: int) -> Array:
    """Return the increments of each step, (runs, steps, samples, 3)."""
    if not beside:
        return rows.reshape(len(rows), -1, count, _AXES)
    cut = np.lib.stride_tricks.sliding_window_view(rows, count + beside, axis=1)[:, ::count]
    return np.ascontiguousarray(np.moveaxis(cut, -1, 2))


def _ends(step: Any, increments: Array, states: Any) -> Array:
    """Return the states after some steps."""
    ends: Array = step.propagate(increments, record_every=increments.shape[1], initial=states)[:, -1]
    return ends


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
