"""Motions of vehicles that vibrate, in closed form, and what an IMU samples of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

DEGREE = np.pi / 180
Array = np.ndarray


class Lines:
    """A vector that is a constant and a sum of sines, with its exact integral."""

    def __init__(self, constant: Array, frequencies: Array, cosines: Array, sines: Array) -> None:
        self.constant, self.w = np.array(constant), 2 * np.pi * np.array(frequencies)
        self.cosines, self.sines = np.array(cosines), np.array(sines)

    def at(self, t: Array) -> Array:
        """Return it at instants (...) in s: (..., 3)."""
        phase = np.asarray(t)[..., None] * self.w
        return self.constant + np.cos(phase) @ self.cosines + np.sin(phase) @ self.sines

    def integral(self, t: Array) -> Array:
        """Return an antiderivative at instants (...): (..., 3)."""
        t = np.asarray(t)[..., None]
        phase = t * self.w
        return t * self.constant + np.sin(phase) / self.w @ self.cosines - np.cos(phase) / self.w @ self.sines


class Motion(NamedTuple):
    """Sampling rate in Hz, body rate in rad/s and specific force in m/s^2."""

    hz: int
    rate: Lines
    force: Lines


def lines(
    rng: np.random.Generator, rms: float, highest: float, constant: tuple, hz: float, radius: float
) -> Lines:
    """Thirty lines of random phases up to a highest frequency, and a circle about z."""
    phases = rng.uniform(0, 2 * np.pi, (30, 3))
    size = rms * np.sqrt(2 / 30)
    return Lines(
        constant,
        [*rng.uniform(0.2, highest, 30), hz],
        [*(size * np.cos(phases)), [radius, 0, 0]],
        [*(size * np.sin(phases)), [0, radius, 0]],
    )


def vehicle(
    hz: int, rate_rms: float, force_rms: float, highest: float, vibration_hz: float, rate: float, force: float
) -> Motion:
    """Return a motion: rms of rate in deg/s and force; frequency, rate and force of the vibration."""
    rng = np.random.default_rng(5)
    return Motion(
        hz,
        lines(rng, rate_rms * DEGREE, highest, (0, 0, 0), vibration_hz, rate),
        lines(rng, force_rms, highest, (0, 0, 9.8), vibration_hz, force),
    )


#: Arguments of `vehicle`: the vibration has the amplitudes at which one kept sample has the errors of the page.
VEHICLES = {
    "quadcopter": (200, 150, 4, 8, 31, 0.43, 18),
    "racer": (500, 600, 15, 12, 78, 1.05, 43),
    "car": (100, 20, 2, 5, 12, 0.38, 5),
}


def motion(name: str, vibration: float = 1.0, turning: float = 1.0) -> Motion:
    """Return the motion of a vehicle whose vibration and whose turning are multiplied."""
    hz, rate_rms, *others, rate, force = VEHICLES[name]
    return vehicle(hz, turning * rate_rms, *others, vibration * rate, vibration * force)


def stamps(hz: int, number: int, jitter: float, seed: int = 0) -> Array:
    """Return stamps in ns whose jitter is a part of the interval."""
    noise = np.random.default_rng(seed).standard_normal(number) * jitter * 1e9 / hz
    return np.arange(number) * (10**9 // hz) + np.round(noise).astype(np.int64)


def samples(motion: Motion, at: Array, kind: str = "increments") -> Array:
    """Return samples of rate and force with stamps, (N, 6)."""
    t = at * 1e-9
    if kind == "instants":
        return np.hstack([motion.rate.at(t), motion.force.at(t)])
    increments = np.diff(np.hstack([motion.rate.integral(t), motion.force.integral(t)]), axis=0, prepend=0)
    return increments / np.diff(t, prepend=-1)[:, None] if kind == "rates" else increments
