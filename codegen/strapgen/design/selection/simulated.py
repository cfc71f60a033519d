"""Simulates algorithms that meet a brief, to compare their drift with the predicted one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.design.brief import DesignBrief, GyroBrief, Line
from strapgen.design.frontier import Candidate
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import Algorithm, algorithm_of
from strapgen.design.selection.judgement import Judgement, after_run, in_order
from strapgen.lab.motions.motions import Motion, motion
from strapgen.lab.motions.rate_profiles import KNOT, CosineSum, ReferenceAttitude
from strapgen.lab.random_runs import Errors, MeanSquare, SteadyRuns, random_runs
from strapgen.lab.runs import Run

#: Fewest steps of a run, and its longest time in s.
_FEWEST, _LONGEST = 200, 10
#: Fewest records of a run whose slope is told from what swings.
_FEWEST_RECORDS = 100
#: Substeps of the reference attitude in a period of the highest frequency.
_SUBSTEPS = 24
_AXES = 3
#: Random runs, the steps of each, and where their random numbers begin.
RANDOM_RUNS, _RANDOM_STEPS, _SEED = 2000, 200, 0


class RandomDrift(NamedTuple):
    """The root mean square of a drift in deg/h, of random runs."""

    mean: float
    #: Its 95 % interval
    low: float
    high: float


@dataclass(frozen=True)
class Simulated:
    """Drifts in time simulations."""

    #: Drift in deg/h of a steady turn at the largest rate
    truncation: float
    #: Drift in deg/h under the vibration, less the true one; None without vibration
    coning: float | None
    #: Drift in deg/h between fixed point and double in the steady turn; words of 64 bits run beside 40 digits
    rounding: float
    #: Drift after the time of the budget that pulses and noise leave in the steady turn: that of shorter random
    #: runs, times the factor by which it grows in the closed form. None without pulses or noise
    quantization: RandomDrift | None
    noise: RandomDrift | None


@dataclass(frozen=True)
class Vibration(Motion):
    """A vibration of lines about x and y, as a gyro measures it."""

    #: As for `Motion`
    name: str = "vibration of a brief"
    parameters: Mapping[str, float] = field(default_factory=dict)
    #: The body rate, and what the gyro passes on of it
    rates: Any = None
    measured: Any = None
    #: Attitudes that were integrated, by shape and times: several algorithms are recorded at the same ones.
    _known: dict[tuple[Any, ...], Any] = field(default_factory=dict, repr=False, compare=False)

    def samples(self, interval: Fraction, first: int, stop: int) -> Any:
        """Return the increments that the gyro measures, see `Motion.samples`."""
        edges = np.arange(first, stop + 1) * float(interval)
        return np.diff(self.measured.angle(edges), axis=0)

    def attitude(self, time: Any) -> Any:
        """Return the true attitude, see `Motion.attitude`."""
        times = np.asarray(time, float)
        key = times.shape, times.tobytes()
        if key not in self._known:
            highest = float(self.rates.frequencies.max()) / (2 * math.pi)
            substeps = max(16, math.ceil(_SUBSTEPS * highest * KNOT))
            self._known[key] = ReferenceAttitude(self.rates.rate, substeps)(times)
        return self._known[key].copy()

    def rate(self, time: Any) -> Any:
        """Return the body rate, see `Motion.rate`."""
        return self.rates.rate(time)


def vibration(lines: Sequence[Line], brief: DesignBrief) -> Vibration:
    """Return the motion of lines, seen by the gyro of a brief."""
    return _vibration(tuple(lines), brief.gyro)


@lru_cache(maxsize=2)
def _vibration(lines: tuple[Line, ...], gyro: GyroBrief) -> Vibration:
    """Return the motion of lines, seen by a gyro, once for all algorithms of a brief."""
    hertz = np.array([line.frequency_hz for line in lines])
    omega = 2 * np.pi * hertz
    still = np.zeros_like(omega)
    sizes = np.array([[line.theta_x, line.theta_y] for line in lines]).T
    phases = start_phases(len(lines)) + np.array([still, [line.phase for line in lines], still])
    # The angle X sin(wt) has the rate X w cos(wt).
    rates = CosineSum(np.array([*sizes, still]) * omega, np.tile(omega, (_AXES, 1)), phases)
    return Vibration(rates=rates, measured=rates.through_gyro(gyro.seen or Response()))


def start_phases(count: int) -> NDArray[np.float64]:
    """Return phases in rad at which lines begin: they have nothing to do with each other, and never all add up."""
    return np.asarray(2 * np.pi * (math.sqrt(2) * np.arange(1, count + 1) % 1), np.float64)


def algorithm_named(judgement: Judgement, brief: DesignBrief, path: str | Path) -> Algorithm:
    """Return the algorithm of a judgement."""
    candidate = Candidate(judgement.method, judgement.increments, judgement.previous, judgement.ahead)
    return algorithm_of(candidate, judgement.state, brief, path)


def run(brief: DesignBrief, judgement: Judgement, algorithm: Algorithm, jobs: int | None = 1) -> Simulated:
    """Run an algorithm that meets a brief in time."""
    drifts = software_drifts(brief, algorithm)
    return Simulated(
        drifts["truncation"],
        drifts.get("coning"),
        algorithm.rounding_drift(_largest_turn(brief), _steps(brief, algorithm), judgement.carry),
        _of_pulses(brief, judgement, algorithm, jobs),
        _of_noise(brief, algorithm, jobs),
    )


def software_drifts(brief: DesignBrief, algorithm: Algorithm) -> dict[str, float]:
    """Return the drifts in deg/h of a run in double, by cause: in the steady turn, and under the vibration.

    Lines begin at phases that have nothing to do with each other.
    """
    steps, step = _steps(brief, algorithm), algorithm.step
    drifts = {"truncation": _slope(algorithm.run(_largest_turn(brief), steps))}
    if brief.environment is not None:
        shaken = vibration(brief.environment.lines(), brief)
        record = _record(step, steps)
        drifts["coning"] = _slope(algorithm.run(shaken, steps - steps % int(record / step), record))
    return drifts


def _steps(brief: DesignBrief, algorithm: Algorithm) -> int:
    """Return the steps of a run."""
    return max(_FEWEST, math.floor(min(Fraction(_LONGEST), brief.budget.over_s) / algorithm.step))


def _largest_turn(brief: DesignBrief) -> Motion:
    """Return the steady turn at the largest rate."""
    return motion("constant", z_deg_s=brief.max_rate_deg_s)


def confirm(brief: DesignBrief, path: str | Path, ordered: Iterable[Judgement]) -> list[Judgement]:
    """Simulate algorithms that meet a brief, the cheapest first, until one meets it in the simulation too.

    What is above fourth order in the angles of lines, and above second order under a spectrum, shows in a run alone.
    """
    left = list(ordered)
    run_ones: list[Judgement] = []
    while left and left[0].meets and not (run_ones and run_ones[-1].meets):
        one = left.pop(0)
        run_ones.append(after_run(brief, one, software_drifts(brief, algorithm_named(one, brief, path))))
    return in_order([*run_ones, *left])


def _of_pulses(
    brief: DesignBrief, judgement: Judgement, algorithm: Algorithm, jobs: int | None
) -> RandomDrift | None:
    """Return the drift of random runs with the gyro's pulses, as the closed form has it grow to the budget's time."""
    if not brief.gyro.pulse_arcsec:
        return None
    pulse = math.radians(float(brief.gyro.pulse_arcsec) / 3600)
    seconds = _RANDOM_STEPS * algorithm.step
    expected = algorithm.quantization(seconds)
    at_the_end = judgement.drift_deg_h["quantization"]
    assert at_the_end is not None, "the algorithm meets the brief"
    outcome = _random(brief, algorithm, Errors(pulse, 0.0, _turn(brief)), jobs)
    return _drift(outcome, float(seconds), at_the_end / expected)


def _of_noise(brief: DesignBrief, algorithm: Algorithm, jobs: int | None) -> RandomDrift | None:
    """Return the drift of random runs with the gyro's noise, which falls with the root of the time."""
    if not brief.gyro.noise_deg_sqrt_h:
        return None
    size = math.radians(brief.gyro.noise_deg_sqrt_h) / 60 / math.sqrt(brief.gyro.sample_hz)
    outcome = _random(brief, algorithm, Errors(0.0, size, _turn(brief)), jobs)
    seconds = float(_RANDOM_STEPS * algorithm.step)
    return _drift(outcome, seconds, math.sqrt(seconds / float(brief.budget.over_s)))


def _turn(brief: DesignBrief) -> float:
    """Return the angle from sample to sample at the largest rate."""
    return math.radians(float(brief.max_rate_deg_s / brief.gyro.sample_hz))


def _random(brief: DesignBrief, algorithm: Algorithm, errors: Errors, jobs: int | None) -> MeanSquare:
    """Return the squared angle at the end of random runs."""
    runs = SteadyRuns(algorithm.steady(), errors, _RANDOM_STEPS, RANDOM_RUNS, (_SEED,))
    return MeanSquare.of(random_runs(runs, jobs=jobs))


def _drift(outcome: MeanSquare, seconds: float, factor: float) -> RandomDrift:
    """Return a squared angle at the end of runs as a drift over the time of the budget."""
    low, high = outcome.interval()
    return RandomDrift(
        *(factor * math.sqrt(square) / seconds * causes.DEG_H for square in (outcome.mean, low, high))
    )


def _record(step: Fraction, steps: int) -> Fraction:
    """Return the interval of records: where the reference attitude is stored, if that leaves enough of them."""
    knot = Fraction(str(KNOT))
    common = Fraction(math.lcm(step.numerator * knot.denominator, knot.numerator * step.denominator))
    common /= step.denominator * knot.denominator
    return common if steps * step >= _FEWEST_RECORDS * common else step


def _slope(run: Run) -> float:
    """Return the slope of the error in deg/h; records in the middle weigh most, so that oscillations cancel."""
    time = run.time - run.time.mean()
    weights = np.hanning(len(time) + 2)[1:-1]
    time = time - np.average(time, weights=weights)
    slope = (weights * time) @ run.drift / (weights @ time**2)
    return float(np.linalg.norm(slope)) * causes.DEG_H
