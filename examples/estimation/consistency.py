"""Errors of an optimiser on simulated visual-inertial data beside its covariance, by each way to preintegrate.

A run has five images in two seconds with the bearings of thirty landmarks, which are known to 0.1 m, and estimates the
biases too. Printed is the mean NEES of the last state (pose, velocity, biases), 15 where the covariance is right.
"""

from __future__ import annotations

import argparse

import gtsam
import numpy as np
from gtsam_factor import gtsam_parameters, imu_factor
from rotations import Array
from scipy.stats import chi2
from simulated_imu import VEHICLES
from visual_inertial import GRAVITY, INTERVALS, SENSORS, Recording, graph_of_images, simulate

import strapgen

WAYS = ("GTSAM", "kept-sample", "pair-1-8")


def imu_factors(
    recording: Recording, way: str, noise: tuple[float, float]
) -> list[list[gtsam.NonlinearFactor]]:
    """Return the factors between the images of each run; keys are X, V and B with numbers."""
    hz, stamps, increments, images, *_ = recording
    keys = [[*map(gtsam.symbol, "xvxvb", (k, k, k + 1, k + 1, 0))] for k in range(INTERVALS)]
    if way == "GTSAM":
        factors = []
        for run in images:
            factors.append([])
            for of, first, last in zip(keys, run[:-1] + 1, run[1:] + 1, strict=True):
                sums = gtsam.PreintegratedImuMeasurements(
                    gtsam_parameters(*noise), gtsam.imuBias.ConstantBias()
                )
                for sample in increments[first:last] * hz:
                    sums.integrateMeasurement(sample[3:], sample[:3], 1 / hz)
                factors[-1].append(gtsam.ImuFactor(*of, sums))
        return factors
    imu = strapgen.Preintegrator(way, sample_hz=hz, rate_noise=noise[0], force_noise=noise[1])
    for stamp, sample in zip(stamps.tolist(), increments, strict=True):
        imu.push(stamp, sample[:3], sample[3:])
    all_of_them = imu.between(stamps[images[:, :-1]], stamps[images[:, 1:]])
    return [
        [imu_factor(of, all_of_them[run, k], GRAVITY) for k, of in enumerate(keys)]
        for run in range(len(images))
    ]


def nees(
    poses: list[gtsam.Pose3], velocities: Array, bias: Array, factors: list, rng: np.random.Generator
) -> float:
    """Return the normalised squared error of the last state that the optimiser finds with those factors."""
    graph, initial = graph_of_images(poses, velocities, rng)
    for factor in factors:
        graph.add(factor)
    found = gtsam.LevenbergMarquardtOptimizer(graph, initial).optimize()
    x, v, b = keys = [gtsam.symbol(*of) for of in (("x", INTERVALS), ("v", INTERVALS), ("b", 0))]
    pose = found.atPose3(x).localCoordinates(poses[-1])
    error = [pose, velocities[-1] - found.atVector(v), bias - found.atConstantBias(b).vector()]
    joint = gtsam.Marginals(graph, found).jointMarginalCovariance(keys)
    covariance = np.block([[joint.at(j, k) for k in keys] for j in keys])
    return np.concatenate(error) @ np.linalg.solve(covariance, np.concatenate(error))


def mean_nees(name: str, sensor: str, way: str, runs: int, **multiplied: float) -> float:
    """Return the mean over runs; every way has the same samples and measurements."""
    recording = simulate(name, sensor, runs, **multiplied)
    factors = imu_factors(recording, way, SENSORS[sensor])
    truths = zip(recording.poses, recording.velocities, recording.biases, factors, strict=True)
    return float(np.mean([nees(*of, np.random.default_rng(1000 + k)) for k, of in enumerate(truths)]))


def band(runs: int) -> tuple[float, float]:
    """Return where 95 % of the means lie if the covariance is right."""
    low, high = chi2.ppf([0.025, 0.975], 15 * runs) / runs
    return low, high


def main() -> None:
    """Print the means of every motion and sensor."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    runs = parser.parse_args().runs
    print("mean NEES of {} runs; 95 % lie between {:.1f} and {:.1f}".format(runs, *band(runs)))
    for sensor in SENSORS:
        for name in VEHICLES:
            found = ", ".join(f"{way} {mean_nees(name, sensor, way, runs):.1f}" for way in WAYS)
            print(f"{name}, {sensor} sensor: {found}", flush=True)


if __name__ == "__main__":
    main()
