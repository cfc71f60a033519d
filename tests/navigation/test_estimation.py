"""The examples of estimation, beside GTSAM, Ceres, and a dense filter that shares no code with them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import strapgen
from strapgen.navigation.preintegration import preintegration_sources

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "estimation"
sys.path.insert(0, str(FOLDER))

import msckf_propagation  # noqa: E402
import simulated_imu  # noqa: E402
import write_recording  # noqa: E402

GRAVITY = np.array([0.0, 0.0, -9.81])


@pytest.fixture
def gtsam():
    return pytest.importorskip("gtsam", reason="GTSAM has no wheel for this Python, or is not installed")


# The filter


def across(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def dense_covariance(start, walk, images, fine=100e-6):
    """Propagate 15 errors and poses by van Loan's exponential over fine steps of the exact rate and force."""
    moved = simulated_imu.motion("quadcopter")
    covariance, r = np.diag(start**2), np.eye(3)
    densities = np.concatenate([np.repeat([1.4e-4, 8e-4], 3), np.zeros(3), walk]) ** 2
    for begin, end in zip(images[:-1] * 1e-9, images[1:] * 1e-9, strict=True):
        size = len(covariance)
        clone = np.eye(size + 6, size)
        clone[size:, [0, 1, 2, 6, 7, 8]] = np.eye(6)
        covariance = clone @ covariance @ clone.T
        count = round((end - begin) / fine)
        h = (end - begin) / count
        for k in range(count):
            rate, force = (signal.at(begin + (k + 0.5) * h) for signal in (moved.rate, moved.force))
            middle, F, G = r @ expm(across(rate) * h / 2), np.zeros((15, 15)), np.zeros((15, 15))
            F[0:3, 0:3], F[0:3, 9:12] = -across(rate), -np.eye(3)
            F[3:6, 0:3], F[3:6, 12:15], F[6:9, 3:6] = -middle @ across(force), -middle, np.eye(3)
            G[:6, :6], G[9:, 9:] = np.diag(densities[:6]), np.diag(densities[9:])
            loan = expm(np.block([[-F, G], [np.zeros((15, 15)), F.T]]) * h)
            phi = np.eye(len(covariance))
            phi[:15, :15] = loan[15:, 15:].T
            covariance = phi @ covariance @ phi.T
            covariance[:15, :15] += loan[15:, 15:].T @ loan[:15, 15:]
            r = r @ expm(across(rate) * h)
    return covariance


@pytest.mark.long
@pytest.mark.parametrize(("start", "walk", "limit"), [(1.0, 1.0, 2e-5), (1e-9, 30.0, 2e-3)])
def test_propagation_of_a_filter_is_that_of_a_dense_one(start, walk, limit):
    """From known states alone the noise is seen, a third of which is that of the walk of the biases."""
    arguments = start * msckf_propagation.START, walk * msckf_propagation.WALK, msckf_propagation.IMAGES[:3]
    found, dense = msckf_propagation.run(*arguments), dense_covariance(*arguments)
    sigmas = np.sqrt(np.diag(dense))
    assert found.shape == dense.shape == (27, 27)
    assert (np.abs(found - dense) / np.outer(sigmas, sigmas)).max() < limit
    without_walk = msckf_propagation.run(arguments[0], 0 * arguments[1], arguments[2])
    if start < 1:
        assert (np.diag(without_walk)[:9] < 0.5 * np.diag(dense)[:9]).all()


# GTSAM


def test_errors_are_those_of_gtsam_where_it_has_nothing_to_correct(gtsam):
    import gtsam_factor

    errors, sigmas = gtsam_factor.compare().values()
    assert errors < 1e-12
    assert sigmas < 2e-3


def differences(factor, values, step=1e-5):
    """Return the derivatives of the whitened error by the factor's states in turn, by differences."""
    import gtsam

    columns, sizes = [], values.dims()
    for key in sorted(sizes):
        for unit in step * np.eye(sizes[key]):
            sides = []
            for sign in (1, -1):
                change = gtsam.VectorValues()
                for other in sizes:
                    change.insert(other, sign * unit if other == key else np.zeros(sizes[other]))
                sides.append(np.asarray(factor.whitenedError(values.retract(change))))
            columns.append((sides[0] - sides[1]) / (2 * step))
    return np.transpose(columns)


def recorded_factor(window="pair-1-5"):
    """Return what is preintegrated between the first images of the recording."""
    stamps, increments, *_ = write_recording.recording()
    imu = strapgen.Preintegrator(window, sample_hz=200, rate_noise=1.4e-4, force_noise=8e-4)
    for stamp, sample in zip(stamps.tolist(), increments, strict=True):
        imu.push(stamp, sample[:3], sample[3:])
    return imu.between(write_recording.IMAGES[:-1], write_recording.IMAGES[1:])


def test_derivatives_of_the_factor_are_those_of_its_errors(gtsam):
    import gtsam_factor

    rng, values = np.random.default_rng(2), gtsam.Values()
    for key in (0, 2):
        values.insert(key, gtsam.Pose3.Expmap(rng.uniform(-1, 1, 6)))
        values.insert(key + 1, rng.uniform(-1, 1, 3))
    values.insert(4, gtsam.imuBias.ConstantBias([0.2, -0.3, 0.1], [0.02, 0.01, -0.03]))
    factor = gtsam_factor.imu_factor([*range(5)], recorded_factor()[0], GRAVITY)
    found, expected = factor.linearize(values).jacobian()[0], differences(factor, values)
    assert found.shape == expected.shape == (9, 24)
    scale = np.abs(expected).max(0)
    assert (scale > 0).all()
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-7)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "way", "multiplied", "inside"),
    [
        ("quadcopter", "GTSAM", {}, False),
        ("quadcopter", "pair-1-8", {}, True),
        ("quadcopter", "kept-sample", {}, True),
        ("racer", "GTSAM", {}, False),
        ("racer", "pair-1-8", {}, True),
        ("car", "pair-1-8", {}, True),
        ("quadcopter", "kept-sample", {"vibration": 4.0}, False),
        ("quadcopter", "pair-1-8", {"vibration": 4.0}, True),
    ],
)
def test_errors_of_an_optimiser_are_as_large_as_it_says(gtsam, name, way, multiplied, inside):
    import consistency

    low, high = consistency.band(100)
    mean = consistency.mean_nees(name, "industrial", way, 100, **multiplied)
    assert (low < mean < high) if inside else mean > 1.2 * high, mean


# Ceres


@pytest.fixture(scope="module")
def estimate(tmp_path_factory):
    """Return what the program for Ceres prints, by its names."""
    folder = tmp_path_factory.mktemp("ceres")
    command = ["c++", "-std=c++17", "-I/usr/include/eigen3"]
    there = subprocess.run(
        [*command, "-E", "-x", "c++", "-"],
        input="#include <ceres/manifold.h>",
        text=True,
        capture_output=True,
    )
    if there.returncode:
        pytest.skip("no headers of Ceres 2.1 on this machine: libceres-dev on Debian")
    header = preintegration_sources.sources("pair-1-5", name="imu").files["imu.hpp"]
    (folder / "imu.hpp").write_text(header)
    program = [str(FOLDER / "estimate.cpp"), "-o", "estimate", "-lceres", "-lglog"]
    subprocess.run([*command, "-O1", "-Wall", "-Wextra", "-I.", *program], cwd=folder, check=True)
    text = subprocess.run(
        [sys.executable, FOLDER / "write_recording.py"], check=True, capture_output=True, text=True
    ).stdout
    done = subprocess.run(["./estimate"], cwd=folder, input=text, capture_output=True, text=True, check=True)
    return {line.rpartition(" by ")[0] or line.split()[0]: line for line in done.stdout.splitlines()}


def numbers(line):
    return np.array([float(word) for word in line.split()[1:]])


@pytest.mark.long
@pytest.mark.needs("c++")
def test_ceres_has_the_errors_and_derivatives_of_the_factor_for_gtsam(estimate, gtsam):
    import gtsam_factor

    assert float(estimate["derivatives, off"].split()[-1]) < 1e-8
    _, _, r, _, p = write_recording.recording()
    poses = [gtsam.Pose3(gtsam.Rot3(turn), place) for turn, place in zip(r[:2], p[:2], strict=True)]
    factor, still = recorded_factor()[0], np.zeros(3)
    states = poses[0], still, poses[1], still, gtsam.imuBias.ConstantBias()
    error, _ = gtsam_factor.residual(factor, GRAVITY, *states)
    whitened = np.linalg.solve(np.linalg.cholesky(factor.covariance), error)
    np.testing.assert_allclose(numbers(estimate["errors"]), whitened, rtol=1e-8)


@pytest.mark.long
@pytest.mark.needs("c++")
def test_ceres_finds_what_gtsam_finds(estimate, gtsam):
    import gtsam_factor

    _, _, r, v, p = write_recording.recording()
    factors = recorded_factor()
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    last = len(r) - 1
    for k in range(last + 1):
        pose = gtsam.Pose3(gtsam.Rot3(r[k]), p[k])
        values.insert(2 * k, pose)
        values.insert(2 * k + 1, np.zeros(3))
        graph.addPriorPose3(2 * k, pose, gtsam.noiseModel.Diagonal.Sigmas(np.repeat([1e-3, 1e-2], 3)))
        if k < last:
            keys = [2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 3, 1000]
            graph.add(gtsam_factor.imu_factor(keys, factors[k], GRAVITY))
    values.insert(1000, gtsam.imuBias.ConstantBias())
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-12)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
    bias = found.atConstantBias(1000)
    expected = np.concatenate([bias.gyroscope(), bias.accelerometer()])
    np.testing.assert_allclose(numbers(estimate["biases"]), expected, atol=1e-5)
    velocity = numbers(estimate["velocity"])
    np.testing.assert_allclose(velocity, found.atVector(2 * last + 1), atol=1e-4)
    np.testing.assert_allclose(velocity, v[-1], atol=0.06)
    assert np.abs(expected - write_recording.BIASES)[:3].max() < 1.5e-3
