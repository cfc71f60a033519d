"""Velocity and position of several algorithms along a motion with a specific force, as a result and drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.design import frontier
from strapgen.design.frontier import STATE, Candidate
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.specific_forces import SpecificForce
from strapgen.lab.recordings.recording import InertialRecording
from strapgen.navigation.courses import course
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable
from strapgen.run.backends import BACKENDS, Backend, backend, evaluator
from strapgen.run.evaluators import Evaluator
from strapgen.run.increments import windows

Array = NDArray[np.float64]

#: Gravity in m/s^2, reference axes with z up.
GRAVITY = (0.0, 0.0, -STANDARD_GRAVITY)


@dataclass(frozen=True)
class Translation:
    """Velocity and position of a run, from rest at the place of the start."""

    #: (N,): times in s, the first one 0
    time: Array
    #: (N, 3): computed, in m/s and m, reference axes
    velocity: Array
    position: Array
    #: (N, 3)
    true_velocity: Array
    true_position: Array

    @property
    def velocity_error(self) -> float:
        """Largest length of the error of the velocity in m/s."""
        return _largest(self.velocity - self.true_velocity)

    @property
    def position_error(self) -> float:
        """Largest length of the error of the position in m."""
        return _largest(self.position - self.true_position)


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def translate(
    attitude: Backend,
    change: Evaluator,
    motion: Motion,
    force: SpecificForce,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    gravity: tuple[float, float, float] = GRAVITY,
    truth: tuple[Array, Array] | None = None,
) -> Translation:
    """Run a step of attitude, velocity and position.

    `step, duration`: step length in s, and duration in s, a multiple of it. `gravity`: in m/s^2, reference
    axes.

    >>> from strapgen import backend
    >>> from strapgen.run.backends import evaluator
    >>> from strapgen.catalogue import choose
    >>> from strapgen.lab.motions.motions import motion
    >>> from strapgen.lab.motions.specific_forces import force
    >>> turn = motion("constant", z_deg_s=90)
    >>> change = evaluator(choose("velocity-position", "magnus4", 2))
    >>> run = translate(backend("euler", "magnus4", 2), change, turn, force("lever", x_m=1), "0.01", 1)
    >>> run.velocity_error < 1e-12, run.position[-1].round(9)
    (True, array([-1.        , -0.57079633, -4.903325  ]))
    """
    h = checks.number("step", step, positive=True)
    steps = checks.multiple("duration", checks.number("duration", duration, positive=True), "step", h)
    samples, previous, ahead = attitude.increments, attitude.previous, attitude.ahead
    interval = h / samples
    angles = motion.increments(h, steps, samples, previous, ahead)
    row = force.velocity_increments(motion, interval, -previous, steps * samples + ahead)
    states = attitude.propagate(angles)
    changes = change(angles, windows(row, samples, previous + ahead))
    if not all(np.isfinite(part).all() for part in (states, *changes)):
        raise InputError("velocity or position is not finite: the increments are too large for the method")
    velocity, position = _sum(states, changes, float(h), np.array(gravity, float))
    time = np.arange(steps + 1, dtype=np.float64) * float(h)
    velocities, positions = truth or force.translation(motion, interval, steps * samples)
    true_velocity, true_position = velocities[::samples], positions[::samples]
    true_velocity = true_velocity + np.outer(time, gravity)
    true_position = true_position + np.outer(time**2 / 2, gravity)
    return Translation(time, velocity, position, true_velocity, true_position)


def _sum(
    states: NDArray[np.generic], changes: tuple[Array, Array], step: float, gravity: Array
) -> tuple[Array, Array]:
    """Return velocity and position after every step, by the kernel of the attitude's algorithm, in double."""
    kernel = evaluator("dcm-translation" if states.ndim == 3 else "euler-translation")
    velocity, position = np.zeros((len(states), 3)), np.zeros((len(states), 3))
    for k, (state, gained, moved) in enumerate(zip(states[:-1], *changes, strict=True)):
        velocity[k + 1], position[k + 1] = kernel(
            state, gained, moved, velocity[k], position[k], gravity, step
        )
    return velocity, position


def _largest(errors: Array) -> float:
    return float(np.linalg.norm(errors, axis=1).max())


#: Name of the recursion in two speeds, and its kernels.
TWO_SPEED, _FAST, _SLOW = "two-speed", "two-speed-fast-2", f"{STATE}-two-speed-slow-2"
#: The kernel of velocity and position.
_CHANGE = "velocity-position"
#: The algorithms that are compared by default.
DEFAULT = (
    *(f"{TWO_SPEED}:2", "rk4:2", "coning-combined:3+3"),
    *("pair-1-5", "pair-1-8", "window-7-7", "window-9-9"),
)
#: Room in the formats of fixed point above the largest increment.
_ROOM = Fraction(9, 8)


@dataclass(frozen=True)
class TranslationRow:
    """Operations of an algorithm for each sample, and its largest errors of velocity and position."""

    name: str = field(metadata=entry("algorithm", align="<"))
    multiply: float = field(metadata=entry("multiply", ".4g"))
    add: float = field(metadata=entry("add", ".4g"))
    velocity_m_s: float = field(metadata=entry("velocity, m/s", ".3g"))
    position_m: float = field(metadata=entry("position, m", ".3g"))


@dataclass(frozen=True)
class TestProfile:
    """The motion, the specific force and the sampling of the runs of all algorithms."""

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

    >>> [one.name for one in candidates(["two-speed:4", "pair-1-8"])]
    ['two-speed:4', 'pair-1-8:1+8+8']
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


def study(several: Sequence[Candidate], profile: TestProfile) -> Iterator[TranslationRow]:
    """Run algorithms along a test profile, and yield cost and errors of each."""
    truth = profile.force.translation(profile.motion, 1 / profile.sample_hz, profile.count)
    for one in several:
        run = _recursion(one, profile, truth) if one.method == TWO_SPEED else _steps(one, profile, truth)
        operations = _operations(one)
        yield TranslationRow(
            one.name, operations["multiply"], operations["add"], run.velocity_error, run.position_error
        )


def _change(one: Candidate) -> Choice:
    """Return the choice of velocity and position by the method of a candidate."""
    return catalogue.choose(_CHANGE, one.method, one.increments, previous=one.previous, ahead=one.ahead)


def _operations(one: Candidate) -> dict[str, float]:
    """Return the operations of an algorithm for each sample."""
    count = one.increments
    if one.method == TWO_SPEED:
        parts = [(Choice(_FAST), 1), (Choice(_SLOW), count)]
    else:
        parts = [(one.choice, count), (_change(one), count)]
    return {
        kind: sum(pipeline.program(choice).operations[kind] / each for choice, each in parts)
        for kind in ("multiply", "add")
    }


def _steps(one: Candidate, profile: TestProfile, truth: tuple[Array, Array]) -> Translation:
    """Return the run of a step, over as many whole steps as the duration holds."""
    step = one.increments / profile.sample_hz
    attitude, change = _settings(one, profile) if BACKENDS[profile.backend].fixed else (None, None)
    return translate(
        backend(one.choice, backend=profile.backend, settings=attitude),
        evaluator(_change(one), profile.backend, change),
        profile.motion,
        profile.force,
        step,
        profile.duration // step * step,
        truth=truth,
    )


def _settings(one: Candidate, profile: TestProfile) -> tuple[Settings, Settings]:
    """Return fixed-point settings for attitude and velocity, with formats that hold the increments."""
    interval, stop = 1 / profile.sample_hz, profile.count + one.ahead
    largest = [
        float(np.abs(rows).max())
        for rows in (
            profile.motion.samples(interval, -one.previous, stop),
            profile.force.velocity_increments(profile.motion, interval, -one.previous, stop),
        )
    ]
    settings = Settings().fitted(largest[0])
    return replace(settings, carry=profile.carry), replace(
        settings, ranges={"velocity_increments": Fraction(largest[1]) * _ROOM}
    )


def _recursion(one: Candidate, profile: TestProfile, truth: tuple[Array, Array]) -> Translation:
    """Return the run of the recursion in two speeds."""
    interval, cycles = 1 / profile.sample_hz, profile.count // one.increments
    stop = cycles * one.increments
    recording = InertialRecording(
        0.0,
        float(interval),
        profile.motion.samples(interval, 0, stop),
        profile.force.velocity_increments(profile.motion, interval, 0, stop),
    )
    along = course(STATE, recording, fast_cycles=one.increments, backend=profile.backend)
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


@dataclass(frozen=True)
class TranslationResult(Result):
    """Velocity and position of several algorithms along a motion with a specific force."""

    rows_in = "algorithms"
    drawn_by: ClassVar[str] = f"{__name__}:translation_image"

    #: The motion and the force in words
    described: str = field(metadata=INTERNAL)
    #: Name of the motion
    motion: str
    #: The specific force: its name and its parameters
    force: dict[str, Any]
    #: Sampling rate
    sample_hz: float
    #: Length of the run
    duration_s: float
    #: Name of the back end
    backend: str
    algorithms: Sequence[TranslationRow]

    @staticmethod
    def of(rows: Sequence[TranslationRow], profile: TestProfile, described: str) -> TranslationResult:
        """Return what algorithms lead to along a profile, which is described in words."""
        force = {"name": profile.force.name, **profile.force.parameters}
        rate, duration = float(profile.sample_hz), float(profile.duration)
        return TranslationResult(described, profile.motion.name, force, rate, duration, profile.backend, rows)

    def table(self) -> TextTable:
        """Return the algorithms under their headers."""
        return reader_table(self.algorithms, TranslationRow)

    def text(self) -> str:
        """Return the table with its head."""
        lines = [
            f"largest errors over {self.duration_s:g} s at {self.sample_hz:g} Hz, back end {self.backend}:",
            self.described,
            "operations for each sample: attitude, velocity and position; N+P+L: samples of a step, from before it, "
            "after it",
            "",
            *self.table().lines(),
        ]
        return "\n".join(lines)


def translation_image(result: TranslationResult, path: str | Path) -> bytes:
    """Return the errors of velocity and position over the multiplications for each sample."""
    figure, grid = figures.grid_of_axes(1, 2, (11, 4.6))
    panels = (("error of the velocity, m/s", "velocity_m_s"), ("error of the position, m", "position_m"))
    several = []
    for axes, (label, part) in zip(grid[0], panels, strict=True):
        points = {one.name: (one.multiply, getattr(one, part)) for one in result.algorithms}
        for x, y in points.values():
            axes.plot([x], [y], "o", color="0.25", markersize=5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("multiplications for each sample")
        axes.set_ylabel(label)
        figures.style(axes)
        several.append((axes, points))
    figures.title(figure, result.described)
    figure.draw_without_rendering()  # axes have their places
    for axes, points in several:
        figures.labels_beside_points(axes, points, dict.fromkeys(points, "0.25"))
    return figures.image(figure, path)
