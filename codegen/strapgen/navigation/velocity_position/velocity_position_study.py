"""Compares algorithms by the velocity and position that they lead to, along a motion with a specific force.

Every algorithm takes the same exact increments. Beside the methods of the attitude stands Savage's recursion in two
speeds, whose position is the velocity summed up by the trapezoidal rule.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.design import frontier
from strapgen.design.frontier import STATE, Candidate
from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.specific_forces import SpecificForce
from strapgen.lab.recordings.recording import InertialRecording
from strapgen.navigation.courses.courses import course
from strapgen.navigation.velocity_position.translations import GRAVITY, Translation, translate
from strapgen.run.backends import BACKENDS, backend, evaluator

Array = NDArray[np.float64]

#: Name of the recursion in two speeds, and its kernels.
TWO_SPEED, _FAST, _SLOW = "two-speed", "two-speed-fast-2", f"{STATE}-two-speed-slow-2"
#: The kernel of velocity and position.
_CHANGE = "velocity-position"
#: The algorithms that are compared by default.
DEFAULT = (
    *(f"{TWO_SPEED}:2", "rk4:2", "coning-combined:3+3"),
    *("window-3-3", "window-5-5", "window-7-7", "window-9-9"),
)
#: Room in the formats of fixed point above the largest increment.
_ROOM = Fraction(9, 8)


@dataclass(frozen=True)
class TranslationStanding:
    """What an algorithm costs, and how far its velocity and position are from the true ones."""

    name: str
    #: Multiplications, and additions and subtractions, for each sample: attitude, velocity and position in body
    #: axes
    multiply: float
    add: float
    #: Largest length of the error in m/s and m
    velocity: float
    position: float


@dataclass(frozen=True)
class Flight:
    """The motion, the force and the sampling that all algorithms share."""

    motion: Motion
    force: SpecificForce
    #: Sampling rate in Hz, and duration in s
    sample_hz: Fraction
    duration: Fraction
    #: A key of `BACKENDS`
    backend: str = "numpy"
    #: Error feedback of the attitude in fixed point
    carry: str = "none"

    @property
    def count(self) -> int:
        """Number of samples."""
        return checks.multiple("duration", self.duration, "sampling interval", 1 / self.sample_hz)


def candidates(names: Iterable[str]) -> list[Candidate]:
    """Return the algorithms of a study, checked.

    >>> [one.name for one in candidates(["two-speed:4", "window-3-3"])]
    ['two-speed:4', 'window-3-3:1+3+3']
    """
    several: list[Candidate] = []
    for name in names:
        method, _, samples = name.partition(":")
        if method == TWO_SPEED:
            several.append(Candidate(TWO_SPEED, checks.whole(f"number of samples in {name}", samples or "2")))
            continue
        new = frontier.candidates([name])
        for one in new:
            _ = _change(one)  # refuses what has no velocity
        several += new
    return several


def study(several: Sequence[Candidate], flight: Flight) -> Iterator[TranslationStanding]:
    """Run algorithms along a flight, and yield what each costs and leads to."""
    truth = flight.force.translation(flight.motion, 1 / flight.sample_hz, flight.count)
    for one in several:
        run = _recursion(one, flight, truth) if one.method == TWO_SPEED else _steps(one, flight, truth)
        operations = _operations(one)
        yield TranslationStanding(
            one.name, operations["multiply"], operations["add"], run.velocity_error, run.position_error
        )


def _change(one: Candidate) -> Choice:
    """Return the choice of velocity and position by the method of a candidate."""
    return catalogue.choose(_CHANGE, one.method, one.increments, previous=one.previous, ahead=one.ahead)


def _operations(one: Candidate) -> dict[str, float]:
    """Return the operations for each sample."""
    count = one.increments
    if one.method == TWO_SPEED:
        parts = [(Choice(_FAST), 1), (Choice(_SLOW), count)]
    else:
        parts = [(one.choice, count), (_change(one), count)]
    return {
        kind: sum(pipeline.program(choice).operations[kind] / each for choice, each in parts)
        for kind in ("multiply", "add")
    }


def _steps(one: Candidate, flight: Flight, truth: tuple[Array, Array]) -> Translation:
    """Return the run of a step, over as many whole steps as the duration holds."""
    step = one.increments / flight.sample_hz
    attitude, change = _settings(one, flight) if BACKENDS[flight.backend].fixed else (None, None)
    return translate(
        backend(one.choice, backend=flight.backend, settings=attitude),
        evaluator(_change(one), flight.backend, change),
        flight.motion,
        flight.force,
        step,
        flight.duration // step * step,
        truth=truth,
    )


def _settings(one: Candidate, flight: Flight) -> tuple[Settings, Settings]:
    """Return settings of fixed point for the attitude and for the velocity, whose formats hold the increments."""
    interval, stop = 1 / flight.sample_hz, flight.count + one.ahead
    largest = [
        float(np.abs(rows).max())
        for rows in (
            flight.motion.samples(interval, -one.previous, stop),
            flight.force.velocity_increments(flight.motion, interval, -one.previous, stop),
        )
    ]
    settings = Settings().fitted(largest[0])
    return replace(settings, carry=flight.carry), replace(
        settings, ranges={"velocity_increments": Fraction(largest[1]) * _ROOM}
    )


def _recursion(one: Candidate, flight: Flight, truth: tuple[Array, Array]) -> Translation:
    """Return the run of the recursion in two speeds."""
    interval, cycles = 1 / flight.sample_hz, flight.count // one.increments
    stop = cycles * one.increments
    recording = InertialRecording(
        0.0,
        float(interval),
        flight.motion.samples(interval, 0, stop),
        flight.force.velocity_increments(flight.motion, interval, 0, stop),
    )
    along = course(STATE, recording, fast_cycles=one.increments, backend=flight.backend)
    cycle = float(one.increments * interval)
    time = np.arange(cycles + 1, dtype=np.float64) * cycle
    begin = np.zeros((1, 3))
    velocity = np.concatenate([begin, np.cumsum(along.velocity_changes, axis=0)]) + np.outer(time, GRAVITY)
    position = np.concatenate([begin, np.cumsum((velocity[1:] + velocity[:-1]) / 2 * cycle, axis=0)])
    true_velocity, true_position = (part[: stop + 1 : one.increments] for part in truth)
    return Translation(
        time,
        velocity,
        position,
        true_velocity + np.outer(time, GRAVITY),
        true_position + np.outer(time**2 / 2, GRAVITY),
    )
