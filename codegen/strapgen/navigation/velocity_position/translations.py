"""`translate` computes attitude, velocity and position along a motion with a specific force, beside the true ones."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.specific_forces import SpecificForce
from strapgen.run.backends import Backend, Evaluator, evaluator
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
    velocity, position = _summed(states, changes, float(h), np.array(gravity, float))
    time = np.arange(steps + 1, dtype=np.float64) * float(h)
    velocities, positions = truth or force.translation(motion, interval, steps * samples)
    true_velocity, true_position = velocities[::samples], positions[::samples]
    true_velocity = true_velocity + np.outer(time, gravity)
    true_position = true_position + np.outer(time**2 / 2, gravity)
    return Translation(time, velocity, position, true_velocity, true_position)


def _summed(
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
