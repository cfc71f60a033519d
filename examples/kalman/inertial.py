"""Inertial navigation of many runs at once in axes e, fixed in the earth, on motions over the earth."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import evaluator
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.sensors import MeasurementUnit
from strapgen.navigation.frame.frame_rates import Earth
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion

Array = NDArray[np.float64]

EARTH = Earth.wgs84()
#: Semi-axes in m, and the rate of the earth in axes e in rad/s.
EQUATOR = EARTH.radius
SQUARE = EARTH.constants["eccentricity_squared"]
POLE = EQUATOR * np.sqrt(1 - SQUARE)
RATE = np.array([0.0, 0.0, EARTH.rate])


def cross(vector: Array) -> Array:
    """Return the matrices [v x] of vectors, (..., 3, 3)."""
    return np.swapaxes(np.cross(vector[..., None, :], np.eye(3)), -1, -2)


def rotation(vector: Array) -> Array:
    """Return the matrices of rotation vectors in rad, (..., 3, 3)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    skew = cross(vector)
    return np.asarray(
        np.eye(3) + np.sinc(angle / np.pi) * skew + np.sinc(angle / np.pi / 2) ** 2 / 2 * skew @ skew
    )


def rotation_vector(matrix: Array) -> Array:
    """Return the rotation vectors in rad of matrices of small angles, (..., 3)."""
    skew = (matrix - np.swapaxes(matrix, -1, -2)) / 2
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)


def level(position: Array) -> tuple[Array, Array]:
    """Return the axes east, north, up of positions in m, as columns in axes e, (..., 3, 3), and the heights in m.

    The latitude is that of B. R. Bowring, Survey Review 23 (1976) 323-327, to 1e-9 m near the earth.
    """
    x, y, z = np.moveaxis(position, -1, 0)
    distance = np.hypot(x, y)
    reduced = np.arctan2(z * EQUATOR, distance * POLE)
    latitude = np.arctan2(
        z + SQUARE / (1 - SQUARE) * POLE * np.sin(reduced) ** 3,
        distance - SQUARE * EQUATOR * np.cos(reduced) ** 3,
    )
    cosine, sine = np.cos(latitude), np.sin(latitude)
    up = np.stack([cosine * x / distance, cosine * y / distance, sine], axis=-1)
    east = np.stack([-y / distance, x / distance, 0 * x], axis=-1)
    transverse = EARTH.transverse_radius(sine)
    height = distance * cosine + (z + SQUARE * transverse * sine) * sine - transverse
    return np.stack([east, np.cross(up, east), up], axis=-1), height


_GRAVITY = evaluator("gravity-ellipsoid")
_CONSTANTS = [EARTH.constants[one.name] for one in _GRAVITY.function.inputs if one.name in EARTH.constants]


def gravity(position: Array) -> Array:
    """Return the gravity at positions in axes e in m/s^2, the centrifugal acceleration included."""
    axes, height = level(position)
    return np.asarray(np.einsum("...ij,...j->...i", axes, _GRAVITY(axes, height, *_CONSTANTS)))


@dataclass
class State:
    """Attitude C_b^e, velocity over the earth in m/s and position in m, axes e, of a vehicle or of many runs."""

    attitude: Array
    velocity: Array
    position: Array

    @classmethod
    def true(cls, motion: VehicleMotion, time: Any) -> State:
        """Return that of a motion at a time in s, or at several."""
        position = motion.position(time)
        return cls(
            position @ motion.navigation_attitude(time),
            np.asarray(np.einsum("...ij,...j->...i", position, motion.velocity(time))),
            motion.cartesian(position[..., 2], motion.height(time)),
        )

    def less(self, true: State) -> Array:
        """Return the errors of attitude in rad, velocity and position, (..., 9)."""
        turned = rotation_vector(self.attitude @ np.swapaxes(true.attitude, -1, -2))
        return np.concatenate([turned, self.velocity - true.velocity, self.position - true.position], axis=-1)

    def corrected(self, errors: Array) -> State:
        """Return the state without errors of attitude, velocity and position, (..., 9)."""
        return State(
            rotation(-errors[..., :3]) @ self.attitude,
            self.velocity - errors[..., 3:6],
            self.position - errors[..., 6:9],
        )

    def advance(self, angle: Array, velocity: Array, step: float, still: bool = False) -> Array:
        """Advance by increments in body axes, (..., 3), and return the specific force in axes e, (..., 3).

        `still`: whether the position is known and held, as in an alignment.
        """
        turned = self.attitude @ rotation(angle)
        half = rotation(-RATE * step / 2)
        force = half @ self.attitude @ (velocity + np.cross(angle, velocity) / 2)[..., None]
        force = force[..., 0] / step
        here = self.position if still else self.position + self.velocity * step / 2
        acceleration = (
            force + gravity(here) - 2 * np.cross(RATE, self.velocity + step / 2 * (force + gravity(here)))
        )
        before = self.velocity
        self.attitude = half @ half @ turned
        self.velocity = self.velocity + step * acceleration
        if not still:
            self.position = self.position + step * (before + self.velocity) / 2
        return np.asarray(force)


def increments(
    motion: VehicleMotion, errors: InstrumentErrors, hz: int, count: int, runs: int
) -> tuple[Array, Array, Array]:
    """Return what the sensors of many runs measure, and their drawn constants.

    Angle increments in rad and velocity increments in m/s, body axes, (count, runs, 3) each; biases of gyros in rad/s
    and of accelerometers in m/s^2, (runs, 6).
    """
    exact = motion.both_samples(Fraction(1, hz), 0, count)
    units = [MeasurementUnit(errors, 1 / hz, run) for run in range(runs)]
    angle, velocity = (
        np.stack(parts, axis=1) for parts in zip(*(unit(*exact) for unit in units), strict=True)
    )
    biases = [np.concatenate([one.errors.gyro.bias, one.errors.accelerometer.bias]) for one in units]
    return angle, velocity, np.array(biases)
