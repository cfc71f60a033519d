"""Simulated visual-inertial data: runs of five images in two seconds, the bearings of thirty landmarks in each."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import gtsam
import numpy as np
from rotations import Array, truth
from simulated_imu import motion, samples

GRAVITY = np.array([0.0, 0.0, -9.81])
INTERVALS, MARGIN, LANDMARKS = 4, 20, 30
#: Densities of the noise of rate and specific force, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz).
SENSORS = {"consumer": (1.7e-4, 3e-3), "industrial": (1.4e-4, 8e-4), "tactical": (1.2e-5, 2e-4)}
#: Standard deviations of the first pose (rad, m) and velocity, the biases (m/s^2, rad/s), landmarks and bearings (rad).
POSE, VELOCITY, BIAS = np.repeat([2e-3, 1e-2], 3), np.full(3, 0.1), np.repeat([2e-2, 1e-3], 3)
LANDMARK, BEARING = np.full(3, 0.1), np.full(2, 2e-3)


class Recording(NamedTuple):
    """Samples of an IMU through all runs, and the true states at the images of each."""

    hz: int
    stamps: Array
    increments: Array  # of angle and velocity, (samples, 6)
    images: Array  # places of the samples that end at them, (runs, images)
    poses: list[list[gtsam.Pose3]]
    velocities: Array  # (runs, images, 3)
    biases: Array  # of force and rate, (runs, 6)


@lru_cache(1)
def simulate(name: str, sensor: str, runs: int, vibration: float = 1.0, turning: float = 1.0) -> Recording:
    """Return runs that are stretches of one motion, each with noise and biases of its own."""
    moved, rng = motion(name, vibration, turning), np.random.default_rng(7)
    hz, length = moved.hz, INTERVALS * moved.hz // 2 + 2 * MARGIN
    stamps = np.arange(runs * length) * (10**9 // hz)
    biases = rng.standard_normal((runs, 6)) * BIAS
    noise = rng.standard_normal((len(stamps), 6)) * np.repeat(SENSORS[sensor], 3) / np.sqrt(hz)
    found = samples(moved, stamps) + noise + np.repeat(biases[:, [3, 4, 5, 0, 1, 2]], length, 0) / hz
    images = length * np.arange(runs)[:, None] + MARGIN + hz // 2 * np.arange(INTERVALS + 1)
    at, T = stamps[images] * 1e-9, 0.5
    parts = truth(moved.rate, moved.force, at[:, :-1].ravel(), at[:, 1:].ravel(), hz)
    turns, pushes, moves = (part.reshape(runs, INTERVALS, *part.shape[1:]) for part in parts)
    r, v, p = [np.tile(np.eye(3), (runs, 1, 1))], [np.zeros((runs, 3))], [np.zeros((runs, 3))]
    for k in range(INTERVALS):
        p.append(p[k] + v[k] * T + GRAVITY * T**2 / 2 + (r[k] @ moves[:, k, :, None])[..., 0])
        v.append(v[k] + GRAVITY * T + (r[k] @ pushes[:, k, :, None])[..., 0])
        r.append(r[k] @ turns[:, k])
    poses = [
        [gtsam.Pose3(gtsam.Rot3(r[k][run]), p[k][run]) for k in range(INTERVALS + 1)] for run in range(runs)
    ]
    return Recording(hz, stamps, found, images, poses, np.stack(v, 1), biases)


def graph_of_images(
    poses: list[gtsam.Pose3], velocities: Array, rng: np.random.Generator
) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Return priors and bearings of a run, and first values; keys are x, v, b and l with numbers."""
    graph, initial = gtsam.NonlinearFactorGraph(), gtsam.Values()
    key, sigmas = gtsam.symbol, gtsam.noiseModel.Diagonal.Sigmas
    for k, (pose, velocity) in enumerate(zip(poses, velocities, strict=True)):
        initial.insert(key("x", k), pose.retract(rng.standard_normal(6) * POSE))
        initial.insert(key("v", k), velocity + rng.standard_normal(3) * VELOCITY)
    graph.addPriorPose3(key("x", 0), initial.atPose3(key("x", 0)), sigmas(POSE))
    graph.addPriorVector(key("v", 0), initial.atVector(key("v", 0)), sigmas(VELOCITY))
    initial.insert(key("b", 0), gtsam.imuBias.ConstantBias())
    graph.addPriorConstantBias(key("b", 0), gtsam.imuBias.ConstantBias(), sigmas(BIAS))
    for k in range(LANDMARKS):
        direction = rng.standard_normal(3)
        place = direction * rng.uniform(25, 40) / np.linalg.norm(direction)
        initial.insert(key("l", k), place + rng.standard_normal(3) * LANDMARK)
        graph.addPriorPoint3(key("l", k), initial.atPoint3(key("l", k)), sigmas(LANDMARK))
        for j, pose in enumerate(poses):
            seen = gtsam.Unit3(pose.transformTo(place)).retract(rng.standard_normal(2) * BEARING)
            graph.add(gtsam.BearingFactor3D(key("x", j), key("l", k), seen, sigmas(BEARING)))
    return graph, initial
