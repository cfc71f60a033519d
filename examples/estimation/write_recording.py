"""Writes a recording of a vibrating quadcopter for estimate.cpp: samples, and measured poses of images."""

from __future__ import annotations

import numpy as np
from rotations import Array, exponential, logarithm, truth
from simulated_imu import motion, samples, stamps

#: Biases of rate and specific force, rad/s and m/s^2, and instants of the images in ns.
BIASES, IMAGES = np.array([1e-3, -2e-3, 3e-3, 0.02, -0.03, 0.01]), 500_000_000 * np.arange(1, 7) + 1_234_567


def recording() -> tuple[Array, Array, Array, Array, Array]:
    """Return stamps, increments of angle and velocity, and rotation, velocity and position at the images."""
    moved, rng = motion("quadcopter"), np.random.default_rng(3)
    at = stamps(moved.hz, 650, jitter=0.01)
    intervals = np.diff(at * 1e-9, prepend=-1 / moved.hz)[:, None]
    noise = rng.standard_normal((len(at), 6)) * np.repeat([1.4e-4, 8e-4], 3) * np.sqrt(intervals)
    ends = IMAGES[:-1] * 1e-9, IMAGES[1:] * 1e-9
    r, v, p, T = [np.eye(3)], [np.zeros(3)], [np.zeros(3)], 0.5
    for turn, push, move in zip(*truth(moved.rate, moved.force, *ends, 200), strict=True):
        p.append(p[-1] + v[-1] * T + np.array([0, 0, -9.81]) * T**2 / 2 + r[-1] @ move)
        v.append(v[-1] + np.array([0, 0, -9.81]) * T + r[-1] @ push)
        r.append(r[-1] @ turn)
    r_measured = np.array(r) @ exponential(1e-3 * rng.standard_normal((len(r), 3)))
    p_measured = np.array(p) + 1e-2 * rng.standard_normal((len(p), 3))
    return at, samples(moved, at) + noise + BIASES * intervals, r_measured, np.array(v), p_measured


def quaternion(r: Array) -> Array:
    """Return a rotation as (x, y, z, w)."""
    turn = logarithm(r)
    angle = max(np.linalg.norm(turn), 1e-12)
    return np.append(np.sin(angle / 2) / angle * turn, np.cos(angle / 2))


def main() -> None:
    """Print the numbers of samples and images, then a line for each."""
    at, increments, r, _, p = recording()
    print(len(at), len(IMAGES))
    for stamp, sample in zip(at, increments, strict=True):
        print(stamp, *sample)
    for stamp, turn, place in zip(IMAGES, r, p, strict=True):
        print(stamp, *quaternion(turn), *place)


if __name__ == "__main__":
    main()
