"""Propagation of a multi-state constraint Kalman filter by preintegrated samples, beside a dense filter.

The error state has attitude (right, R_estimated = R_true exp(theta x)), velocity, position and the biases of rate and
force: 15. Poses of earlier images follow it and stay; their correlation with it goes on by the transition.
"""

from __future__ import annotations

import numpy as np
from rotations import Array, cross
from simulated_imu import motion, samples, stamps

import strapgen

#: Nodes and weights of Gauss from 0 to 1, for the walk of the biases within an interval.
NODES, WEIGHTS = (np.polynomial.legendre.leggauss(3) + np.array([[1.0], [0.0]])) / 2


def transition(factor: strapgen.Preintegrated, r_i: Array) -> Array:
    """Return the transition of the 15 errors over an interval, whose rotation at t_i is given."""
    T = factor.duration
    phi = np.eye(15)
    phi[:3, :3] = factor.rotation.T
    phi[3:6, :3] = -r_i @ cross(factor.velocity)
    phi[6:9, :3] = -r_i @ cross(factor.position)
    phi[6:9, 3:6] = T * np.eye(3)
    phi[:9, 9:] = _turned(r_i) @ factor.jacobian
    return phi


def _turned(r_i: Array) -> Array:
    """Return what takes the nine errors of a factor to those of the state."""
    turned = np.eye(9)
    turned[3:6, 3:6] = turned[6:, 6:] = r_i
    return turned


def interval(
    imu: strapgen.Preintegrator, begin: int, end: int, biases: Array, r_i: Array, walk: Array
) -> tuple[Array, Array, Array]:
    """Return transition, added covariance and the rotation at the end of an interval; walk has densities (6,)."""
    starts = begin + np.round((end - begin) * NODES).astype(int)
    factors = imu.between([begin, *starts], end, *np.split(biases, 2))
    factor, r_j = factors[0], r_i @ factors.rotation[0]
    added = np.zeros((15, 15))
    added[:9, :9] = _turned(r_i) @ factor.covariance @ _turned(r_i).T
    # A step of the biases at an instant goes on to the end as an error of theirs does from there.
    for weight, rest in zip(WEIGHTS, (factors[k] for k in (1, 2, 3)), strict=True):
        by_biases = transition(rest, r_j @ rest.rotation.T)[:, 9:]
        added += weight * factor.duration * by_biases @ np.diag(walk**2) @ by_biases.T
    return transition(factor, r_i), added, r_j


def propagate(covariance: Array, phi: Array, added: Array) -> Array:
    """Return the covariance of the 15 errors and of the poses that follow them, at t_j."""
    result = covariance.copy()
    result[:15, :15] = phi @ covariance[:15, :15] @ phi.T + added
    result[:15, 15:] = phi @ covariance[:15, 15:]
    result[15:, :15] = result[:15, 15:].T
    return result


def augment(covariance: Array) -> Array:
    """Return the covariance with the attitude and position of now as a further pose."""
    copied = np.r_[np.arange(len(covariance)), 0:3, 6:9]
    return covariance[np.ix_(copied, copied)]


def run(start: Array, walk: Array, images: Array) -> Array:
    """Return the covariance at the last image of a vibrating quadcopter, with a pose of each image before it."""
    moved = motion("quadcopter")
    imu = strapgen.Preintegrator("pair-1-8", sample_hz=moved.hz, rate_noise=1.4e-4, force_noise=8e-4)
    at = stamps(moved.hz, int(images[-1] * 1e-9 * moved.hz) + 30, jitter=0.01)
    for stamp, sample in zip(at.tolist(), samples(moved, at), strict=True):
        imu.push(stamp, sample[:3], sample[3:])
    covariance, r = np.diag(start**2), np.eye(3)
    for begin, end in zip(images[:-1].tolist(), images[1:].tolist(), strict=True):
        phi, added, r = interval(imu, begin, end, np.zeros(6), r, walk)
        covariance = propagate(augment(covariance), phi, added)
    return covariance


#: Standard deviations at the start: attitude in rad, velocity in m/s, position in m, biases in rad/s and m/s^2.
START = np.repeat([1e-3, 1e-2, 1e-2, 1e-3, 1e-2], 3)
#: Densities of the walk of the biases, rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz), and instants of images in ns.
WALK, IMAGES = np.repeat([1e-4, 1e-3], 3), 100_000_000 * np.arange(1, 12) + 1_234_567


if __name__ == "__main__":
    sigmas = np.sqrt(np.diag(run(START, WALK, IMAGES)))
    for name, place in {"attitude, rad": 0, "velocity, m/s": 3, "position, m": 6}.items():
        print(f"{name}: {sigmas[place : place + 3].max():.2e}")
