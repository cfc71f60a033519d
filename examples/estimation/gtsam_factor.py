"""A factor of GTSAM from preintegrated samples: this compares it with GTSAM's own."""

from __future__ import annotations

import gtsam
import numpy as np
from rotations import Array, cross, exponential, logarithm, right_jacobian

import strapgen

#: Column of each derivative by ``imuBias.ConstantBias``, which has the accelerometer first.
FORCE_FIRST = [3, 4, 5, 0, 1, 2]


def residual(
    factor: strapgen.Preintegrated,
    gravity: Array,
    pose_i: gtsam.Pose3,
    velocity_i: Array,
    pose_j: gtsam.Pose3,
    velocity_j: Array,
    bias: gtsam.imuBias.ConstantBias,
) -> tuple[Array, list[Array]]:
    """Return what the samples say less what the states say, and its derivatives by the five states.

    The nine are the right rotation error in the axes at t_j, and velocity and position in the axes at t_i: those of the
    covariance.
    """
    change = factor.jacobian[:3, :3] @ (bias.gyroscope() - factor.rate_bias)
    moved = factor.at(bias.gyroscope(), bias.accelerometer())
    T, back = factor.duration, pose_i.rotation().matrix().T
    apart = back @ pose_j.rotation().matrix()
    gained = back @ (velocity_j - velocity_i - gravity * T)
    gone = back @ (pose_j.translation() - pose_i.translation() - velocity_i * T - gravity * T**2 / 2)
    turn = logarithm(apart.T @ moved.rotation)
    inverse = np.linalg.inv(right_jacobian(turn))
    by_pose_i, by_pose_j, by_velocity_i, by_velocity_j = (np.zeros((9, n)) for n in (6, 6, 3, 3))
    by_pose_i[:3, :3], by_pose_i[3:6, :3], by_pose_i[6:, :3] = (
        inverse @ moved.rotation.T,
        -cross(gained),
        -cross(gone),
    )
    by_pose_i[6:, 3:] = np.eye(3)
    by_pose_j[:3, :3], by_pose_j[6:, 3:] = -inverse @ exponential(-turn), -apart
    by_velocity_i[3:6], by_velocity_i[6:] = back, T * back
    by_velocity_j[3:6] = -back
    by_bias = factor.jacobian.copy()
    by_bias[:3, :3] = inverse @ right_jacobian(change) @ by_bias[:3, :3]
    error = np.concatenate([turn, moved.velocity - gained, moved.position - gone])
    return error, [by_pose_i, by_velocity_i, by_pose_j, by_velocity_j, by_bias[:, FORCE_FIRST]]


def imu_factor(keys: list[int], factor: strapgen.Preintegrated, gravity: Array) -> gtsam.CustomFactor:
    """Return the factor of one interval: keys of pose and velocity at t_i, at t_j, and of the bias.

    The bias at t_j, if it is another, is tied to this one by a factor of its own, ``BetweenFactorConstantBias``.
    """

    def error(_: gtsam.CustomFactor, values: gtsam.Values, jacobians: list[Array] | None) -> Array:
        x_i, v_i, x_j, v_j, bias = keys
        states = values.atPose3(x_i), values.atVector(v_i), values.atPose3(x_j), values.atVector(v_j)
        found, derivatives = residual(factor, gravity, *states, values.atConstantBias(bias))
        if jacobians is not None:
            for place, derivative in enumerate(derivatives):
                jacobians[place] = derivative
        return found

    return gtsam.CustomFactor(gtsam.noiseModel.Gaussian.Covariance(factor.covariance), keys, error)


def gtsam_parameters(
    rate_noise: float, force_noise: float, integration: float = 1e-8
) -> gtsam.PreintegrationParams:
    """Return GTSAM's parameters for densities of noise, with z upwards; of integration that of its examples."""
    parameters = gtsam.PreintegrationParams.MakeSharedU(9.81)
    parameters.setGyroscopeCovariance(rate_noise**2 * np.eye(3))
    parameters.setAccelerometerCovariance(force_noise**2 * np.eye(3))
    parameters.setIntegrationCovariance(integration * np.eye(3))
    return parameters


def compare() -> dict[str, float]:
    """Turn about a fixed axis with a force along it, where GTSAM has nothing to correct, and compare."""
    rate, force, interval = np.array([0.3, -0.6, 0.9]), np.array([-2.0, 4.0, -6.0]), 5_000_000
    imu = strapgen.Preintegrator(
        "pair-1-5", sample_hz=200, input="rates", rate_noise=1.4e-4, force_noise=8e-4
    )
    for k in range(140):
        imu.push(interval * k, rate, force)
    factor = imu.between(20 * interval, 120 * interval)
    parameters = gtsam_parameters(1.4e-4, 8e-4, integration=1e-18)
    parameters.setImuFactorErrorMode(gtsam.ImuFactorErrorMode.ComponentWise)
    sums = gtsam.PreintegratedImuMeasurements(parameters, gtsam.imuBias.ConstantBias())
    for _ in range(100):
        sums.integrateMeasurement(force, rate, interval * 1e-9)
    rng, values = np.random.default_rng(1), gtsam.Values()
    for key in (0, 2):
        values.insert(key, gtsam.Pose3.Expmap(rng.uniform(-1, 1, 6)))
        values.insert(key + 1, rng.uniform(-1, 1, 3))
    values.insert(4, gtsam.imuBias.ConstantBias())
    ours = imu_factor([*range(5)], factor, np.array([0, 0, -9.81]))
    error, theirs = ours.unwhitenedError(values), gtsam.ImuFactor(*range(5), sums).unwhitenedError(values)
    apart = (values.atPose3(2).rotation().inverse() * values.atPose3(0).rotation()).matrix()
    in_their_axes = np.concatenate([error[:3], apart @ error[6:], apart @ error[3:6]])
    sigmas = np.sqrt(np.diag(sums.preintMeasCov())[3:]) / np.sqrt(
        np.diag(factor.covariance)[[6, 7, 8, 3, 4, 5]]
    )
    return {
        "errors, beside ImuFactor": np.abs(in_their_axes - theirs).max(),
        "sigmas of position and velocity, over those of ImuFactor, less 1": np.abs(sigmas - 1).max(),
    }


if __name__ == "__main__":
    for what, figure in compare().items():
        print(f"{what}: {figure:.1e}")
