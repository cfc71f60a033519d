"""The error of an attitude beside a true one, held by SciPy's rotations and by motions whose errors are put in."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from strapgen import backend
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import quaternions
from strapgen.lab.recordings.recording import History, Recording, propagate
from strapgen.lab.recordings.true_attitude import (
    Slope,
    TrueAttitude,
    attitude_error,
    time_offset,
)

HZ, SECONDS = 200, 60
#: The turn of the true reference axes, and that of the true body axes.
TURNED, MOUNTED = Rotation.from_rotvec([0.3, -1.1, 0.7]), Rotation.from_rotvec([1.2, 0.4, -0.9])


def body_rate(time: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(1.3 * time) + 0.2, 0.8 * np.cos(0.7 * time), np.sin(2.1 * time + 1)], axis=-1)


@pytest.fixture(scope="module")
def motion() -> tuple[np.ndarray, Rotation, Recording]:
    """Times, attitudes and a recording of a motion; SciPy integrates fine steps."""
    fine = 10
    step = 1 / HZ / fine
    middles = (np.arange(SECONDS * HZ * fine) + 0.5) * step
    turns = Rotation.from_rotvec(body_rate(middles) * step)
    attitudes = [Rotation.identity()]
    for turn in turns:
        attitudes.append(attitudes[-1] * turn)
    time = np.arange(SECONDS * HZ + 1) / HZ
    increments = (body_rate(middles) * step).reshape(-1, fine, 3).sum(axis=1)
    return time, Rotation.concatenate(attitudes[::fine]), Recording(0.0, 1 / HZ, increments)


@pytest.fixture(scope="module")
def history(motion) -> History:
    return propagate(backend("euler", "rk4", 2), motion[2])


def truth(motion, *, offset=0.0, hz=37.0, left=None, right=None, jitter=0.0) -> TrueAttitude:
    """The motion's attitude with stamps of its own, in turned frames."""
    time, attitudes, _ = motion
    rng = np.random.default_rng(3)
    at = np.arange(1.013, SECONDS - 1, 1 / hz)
    at = at + rng.uniform(-jitter, jitter, at.shape) / hz
    values = Slerp(time, attitudes)(at)
    values = (left or Rotation.identity()) * values * (right or Rotation.identity())
    return TrueAttitude.of(at + offset, values.as_quat())


# Quaternions


def test_quaternions_are_those_of_scipy():
    rng = np.random.default_rng(1)
    some, others = Rotation.random(200, rng=rng), Rotation.random(200, rng=rng)
    p, q = some.as_quat(), others.as_quat()
    np.testing.assert_allclose(quaternions.matrices(p), some.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(
        np.abs((quaternions.product(p, q) * (some * others).as_quat()).sum(axis=1)), 1, atol=1e-14
    )
    np.testing.assert_allclose(quaternions.rotation_vectors(p), some.as_rotvec(), atol=1e-12)
    np.testing.assert_allclose(
        quaternions.matrices(quaternions.from_rotation_vectors(some.as_rotvec())),
        some.as_matrix(),
        atol=1e-14,
    )


@pytest.mark.parametrize("length", [1, 0.99])
@pytest.mark.parametrize("axis", [*np.eye(3), [1, 1, 1], [1, -1, 0]])
def test_half_turns_and_small_ones_come_back_from_matrices(axis, length):
    angles = np.array([0, 1e-9, 1e-3, 1, math.pi - 1e-9, math.pi])
    rotations = Rotation.from_rotvec(np.outer(angles, axis) / np.linalg.norm(axis))
    q = quaternions.from_matrices(length * rotations.as_matrix())
    assert ((Rotation.from_quat(q) * rotations.inv()).magnitude() < 1e-14).all()
    assert ((q[1:] * q[:-1]).sum(axis=1) >= 0).all() and q[0, 3] >= 0


def test_interpolation_is_that_of_scipy():
    time = np.array([0, 0.3, 1.0, 1.1])
    attitudes = Rotation.random(4, rng=np.random.default_rng(2))
    at = np.linspace(0, 1.1, 50)
    found = Rotation.from_quat(quaternions.interpolated(time, attitudes.as_quat(), at))
    assert ((found * Slerp(time, attitudes)(at).inv()).magnitude() < 1e-13).all()


# The clock


@pytest.mark.parametrize("offset", [0.0, 0.0123, -1.5, 1.7e9])
def test_offset_of_the_clock_is_found(motion, offset):
    """Stamps of 2026 in double have a resolution of 2.4e-7 s."""
    found = time_offset(motion[2], truth(motion, offset=offset, left=TURNED, right=MOUNTED, jitter=0.3))
    assert abs(found.seconds - offset) < max(4 * found.uncertainty_s, 1e-6)
    assert found.uncertainty_s < 2e-4 and found.correlation > 0.999


def test_uncertainty_of_the_offset_covers_noise(motion):
    """Of many noises of the truth, most offsets are within two standard deviations."""
    _, _, recording = motion
    exact = truth(motion, offset=0.02)
    inside = []
    for seed in range(12):
        noise = np.random.default_rng(seed).normal(0, 2e-3, (len(exact.time), 3))
        rough = Rotation.from_quat(exact.quaternions) * Rotation.from_rotvec(noise)
        found = time_offset(recording, TrueAttitude.of(exact.time, rough.as_quat()))
        assert 1e-5 < found.uncertainty_s < 5e-3
        inside.append(abs(found.seconds - 0.02) < 2 * found.uncertainty_s)
    assert sum(inside) >= 9


def test_other_motion_has_no_offset(motion):
    time = motion[0]
    other = Rotation.from_rotvec(np.random.default_rng(4).normal(0, 1, (len(time), 3)))
    with pytest.raises(InputError, match=r"^the rates .* have a correlation of 0.[0-4]"):
        time_offset(motion[2], TrueAttitude.of(time, other.as_quat()))


# The error


def test_same_attitude_has_no_error(motion, history):
    found = attitude_error(history, truth(motion))
    assert found.align == "start" and len(found.time) == len(truth(motion).time)
    # Interpolation at a constant rate errs by an eighth of the angular acceleration times the step squared.
    assert found.angle.max() < 2 * 3 * 0.01**2 / 8


@pytest.mark.parametrize(
    ("align", "left", "right"),
    [("start", TURNED, None), ("mean", TURNED, None), ("mounting", TURNED, MOUNTED)],
)
def test_frames_are_turned_on_request(motion, history, align, left, right):
    true = truth(motion, left=left, right=right)
    found = attitude_error(history, true, align=align)
    assert found.angle.max() < 1e-4
    assert (Rotation.from_quat(found.reference) * left.inv()).magnitude() < 1e-4
    if right is not None:
        assert (Rotation.from_quat(found.body) * right.inv()).magnitude() < 1e-4
    others = attitude_error(history, true, align="none")
    assert others.angle.max() > 0.5, "in silence no frame is turned"


def test_slope_is_the_bias_that_is_put_in(motion):
    """A bias of the reference axes' rate, since a turning body averages one of its own."""
    time, attitudes, recording = motion
    bias = np.radians([20, -10, 5]) / 3600
    middles = Slerp(time, attitudes)((time[1:] + time[:-1]) / 2)
    measured = Recording(0.0, 1 / HZ, recording.samples + middles.inv().apply(bias) / HZ)
    found = attitude_error(propagate(backend("euler", "rk4", 2), measured), truth(motion))
    np.testing.assert_allclose(found.slope.deg_h, [20, -10, 5], atol=0.05)
    assert found.angle_slope.deg_h == pytest.approx(math.sqrt(525), abs=0.05)


def test_error_vector_turns_the_truth_into_what_is_computed(motion, history):
    turned = Rotation.from_rotvec([0, 0.02, 0])
    true = truth(motion, left=turned)
    found = attitude_error(history, true, align="none")
    np.testing.assert_allclose(found.vector, np.tile([0, -0.02, 0], (len(found.time), 1)), atol=3e-5)


@pytest.mark.parametrize(("walk", "white", "least", "most"), [(1e-6, 0, 0.7, 1.6), (0, 1e-4, 0.05, 1)])
def test_uncertainty_of_the_slope_covers_noise(walk, white, least, most):
    """It is that of a random walk, and wide for white noise."""
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(200):
        values = np.cumsum(rng.normal(0, walk, 2000)) + rng.normal(0, white, 2000)
        slope = Slope.of(np.arange(2000.0), values)
        ratios.append(float(slope.deg_h / slope.uncertainty_deg_h))
    assert least < np.std(ratios) < most


def test_gaps_of_the_truth_are_left_out(motion, history):
    true = truth(motion, hz=400)  # denser than the steps, whose instants then count
    kept = (true.time < 20) | (true.time > 21)
    found = attitude_error(history, TrueAttitude.of(true.time[kept], true.quaternions[kept]))
    assert not ((found.time > 20.01) & (found.time < 20.99)).any()
    at = found.at(np.array([19.0, 20.5, 25.0, 59.9]))
    assert np.isnan(at).all(axis=1).tolist() == [False, True, False, True]


def test_truth_in_the_other_sense_is_told(motion, history):
    right = truth(motion, left=TURNED)
    wrong = TrueAttitude(right.time, quaternions.inverse(right.quaternions))
    mounted = truth(motion, right=MOUNTED)
    assert "the other sense" in attitude_error(history, wrong, align="mean").lines()[-1]
    assert not attitude_error(history, truth(motion)).doubt
    assert not attitude_error(history, mounted).doubt, "a mounting is no sense"


# What is refused


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([0, 1], [[1, 0, 0]] * 2), "(2, 4) or (2, 3, 3) is needed"),
        (([0, 1], [[2, 0, 0, 0]] * 2), "row 1 has length 2; 1 is needed"),
        (([1, 0], [[1, 0, 0, 0]] * 2), "time 0 s in row 2 does not rise"),
        (([0, 1], [[1, 0, 0, 0], [0, 0, 0, 0]]), "holds 1 attitude; at least 2"),
        (([0, 1], [[1, 0, 0, 0]] * 2, "xyzw"), "order 'xyzw' is not known"),
        (([0, 1], [[1, 0, 0, 0]] * 2, "xyzs", "body"), "sense 'body' is not known"),
    ],
)
def test_wrong_truth_is_refused(arguments, said):
    time, attitudes, *more = arguments
    with pytest.raises(InputError) as caught:
        TrueAttitude.of(time, attitudes, **dict(zip(("order", "sense"), more, strict=False)))
    assert said in str(caught.value)


def test_matrices_are_a_truth_too():
    attitudes = Rotation.random(5, rng=np.random.default_rng(6))
    one = TrueAttitude.of(range(5), attitudes.as_matrix())
    other = TrueAttitude.of(range(5), attitudes.as_quat(scalar_first=True), order="sxyz")
    back = TrueAttitude.of(range(5), attitudes.inv().as_matrix(), sense="reference-to-body")
    for true in (one, other, back):
        assert ((Rotation.from_quat(true.quaternions) * attitudes.inv()).magnitude() < 1e-14).all()


def test_clocks_that_do_not_overlap_are_refused(motion, history):
    with pytest.raises(InputError, match=r"^the truth is from 1001\.013 s to .* overlap$"):
        attitude_error(history, truth(motion, offset=1000))


def test_turn_about_one_axis_tells_no_mounting(motion):
    spin = propagate(backend("euler"), Recording(0.0, 0.01, np.full((1000, 3), (0, 0, 0.01))))
    true = TrueAttitude.of(spin.time, quaternions.from_matrices(spin.matrices()))
    with pytest.raises(InputError, match="turns about two axes"):
        attitude_error(spin, true, align="mounting")
