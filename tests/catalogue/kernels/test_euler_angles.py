"""Euler angles: round trips at every attitude, and no jump where pitch is vertical."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import sympy as sp
from scipy.spatial.transform import Rotation
from tolerances import one_call

import strapgen
from strapgen import derive
from strapgen.run.backends import BACKENDS, Evaluator

EPS = 2.0**-52
TURN = 2 * np.pi


def kernels(backend: str = "numpy") -> tuple[Evaluator, Evaluator]:
    return strapgen.evaluator("dcm-from-euler-angles", backend), strapgen.evaluator(
        "euler-angles-from-dcm", backend
    )


def apart(angles, others):
    """Return the difference of angles without whole turns."""
    difference = np.abs(np.asarray(angles) - others)
    return np.min([difference, np.abs(difference - TURN), np.abs(difference - 2 * TURN)], axis=0)


def random_angles(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return angles of attitudes that are evenly spread, a tenth of them at steep pitch."""
    pitch = np.arcsin(rng.uniform(-1, 1, count))
    steep = count // 10
    nearness = 10.0 ** rng.uniform(-17, 0, steep)
    pitch[:steep] = rng.choice([-1, 1], steep) * (np.pi / 2 - nearness)
    return np.stack([rng.uniform(-np.pi, np.pi, count), pitch, rng.uniform(-np.pi, np.pi, count)], axis=-1)


def corners() -> np.ndarray:
    """Return the matrices of all quarter turns, and of half turns about axes between."""
    turns = [
        Rotation.from_euler("ZYX", q, degrees=True).as_matrix().round()
        for q in product((-90, 0, 90, 180), repeat=3)
    ]
    axes = [np.array(axis) for axis in product((-1, 0, 1), repeat=3) if any(axis)] + [np.array([1, 2, -2])]
    halves = [2 * np.outer(n, n) / (n @ n) - np.eye(3) for n in axes]
    return np.array([*turns, *halves])


def check_matrices(matrices: np.ndarray, backend: str = "numpy") -> None:
    """Matrix to angles and back: the angles, rounded, hold it to half a last place each; the rest is 4 of them."""
    to, of = kernels(backend)
    back = of(matrices, np.zeros(3))
    rounding = (np.spacing(np.abs(back)) / 2).sum(axis=-1)
    error = np.abs(to(back) - matrices).max(axis=(-2, -1))
    assert np.all(error <= rounding + 4 * EPS)
    assert np.all(np.abs(back[..., 1]) <= np.pi / 2)
    assert np.all(np.abs(back) <= np.pi)


def check_angles(angles: np.ndarray, backend: str = "numpy") -> None:
    """Angles to matrix and back: roll and heading are as good as the matrix over the cosine of pitch."""
    to, of = kernels(backend)
    matrices = to(angles)
    back = of(matrices, np.zeros(3))
    cosine = np.hypot(matrices[:, 0, 0], matrices[:, 1, 0])
    told = cosine > 2 * EPS  # elsewhere roll is held
    assert np.all(apart(back[:, 1], angles[:, 1]) <= 4 * EPS)
    for k in (0, 2):
        assert np.all(apart(back[told, k], angles[told, k]) * cosine[told] <= 4 * EPS)
    # What the matrix does tell at every pitch: heading less roll above the horizon, their sum below.
    sign = np.where(angles[:, 1] > 0, -1, 1)
    known = apart(back[:, 2] + sign * back[:, 0], angles[:, 2] + sign * angles[:, 0])
    assert np.all(known <= 8 * EPS + 2 * cosine * ~told)


DOUBLE = pytest.mark.parametrize("backend", ["numpy", "c"])


@DOUBLE
@pytest.mark.parametrize("count", [20_000, pytest.param(200_000, marks=pytest.mark.long)])
def test_round_trips_of_random_attitudes(count, backend, rng):
    angles = random_angles(count, rng)
    check_angles(angles, backend)
    matrices = Rotation.random(count, rng=rng).as_matrix()
    matrices[: count // 10] = kernels(backend)[0](angles[: count // 10])
    check_matrices(matrices, backend)


@DOUBLE
def test_round_trips_of_corners_and_half_turns(backend):
    check_matrices(corners(), backend)
    quarters = np.array(list(product((-np.pi, -np.pi / 2, 0, np.pi / 2, np.pi), repeat=3)))
    check_angles(quarters[np.abs(quarters[:, 1]) < 2], backend)


def test_the_matrix_is_scipys(rng):
    angles = random_angles(200, rng)
    wanted = Rotation.from_euler("ZYX", angles[:, ::-1]).as_matrix()
    np.testing.assert_allclose(kernels()[0](angles), wanted, rtol=0, atol=4 * EPS)


def test_the_singular_cases_hold_at_every_pitch():
    # (63) from (60): 1 + sin(pitch) times sine and cosine of heading - roll; 1 - sin(pitch) of heading + roll.
    roll, pitch, heading = sp.symbols("roll pitch heading", real=True)
    C = sp.Matrix(3, 3, derive("dcm-from-euler-angles").expand()["attitude"])
    up, down = 1 + sp.sin(pitch), 1 - sp.sin(pitch)
    for made, wanted in (
        (C[1, 2] - C[0, 1], up * sp.sin(heading - roll)),
        (C[1, 1] + C[0, 2], up * sp.cos(heading - roll)),
        (-C[1, 2] - C[0, 1], down * sp.sin(heading + roll)),
        (C[1, 1] - C[0, 2], down * sp.cos(heading + roll)),
    ):
        assert sp.expand(sp.expand_trig(made - wanted)) == 0


def known_to(of: Evaluator, cosine: float) -> tuple[np.ndarray, float]:
    """Return how well a matrix tells the angles, and the one angle between or together, at a cosine of pitch.

    In fixed point each element is off by half a unit: roll and heading are directions of two elements that make the
    cosine, (63) is one of two sums of two elements that make 1.8 or more where it is used, pitch is one of three
    elements that make 1. What is certified of the arithmetic comes to it. In floating point elements are off relative
    to themselves, and so no direction is lost; an angle of up to a turn and a half is rounded three times.
    """
    interface = getattr(of, "interface", None)
    if interface is None:
        return np.full(3, 8 * float(np.finfo(of.dtype).eps)), 16 * float(np.finfo(of.dtype).eps)
    half = float(interface.inputs[0].format.unit) / 2
    roll, pitch, heading = (float(error) for error in interface.outputs[0].errors)
    direction = np.arcsin(min(np.sqrt(2) * half / cosine, 1.0))
    steep = np.sqrt(2) * 2 * half / 1.8
    between = 2 * direction if cosine > 0.5 else steep
    angles = [direction + roll, np.sqrt(3) * half + pitch, direction + steep + heading]
    return np.array(angles), between + roll + heading


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("roll", "heading"), [(0.3, 1.0), (-2.0, 3.0), (3.0, -3.1), (0.0, 0.0)])
def test_nothing_jumps_on_the_way_to_vertical_pitch(roll, heading, sign, backend_name):
    # Nose up, or down, in smaller and smaller steps until nothing tells roll from heading, and on the spot.
    to = kernels()[0]
    of = strapgen.evaluator("euler-angles-from-dcm", backend_name)
    steps = np.concatenate([10.0 ** -np.arange(0, 18, 0.5), [0, 0]])
    pitches = sign * (np.pi / 2 - steps)
    matrices = to(np.stack([np.full_like(pitches, roll), pitches, np.full_like(pitches, heading)], axis=-1))
    # Vertical to the last place, as a table of cosines has it, not as the cosine of a rounded angle.
    matrices[-1, :, 0] = [0, 0, -sign]
    matrices[-1, 2] = [-sign, 0, 0]
    unit = (
        float(of.interface.inputs[0].format.unit) if BACKENDS[backend_name].fixed else np.finfo(of.dtype).eps
    )
    before, last, last_pitch = np.array([roll, pitches[0], heading]), None, 0.0
    for matrix, pitch in zip(matrices, pitches, strict=True):
        angles = np.asarray(of(matrix, before.astype(of.dtype)), float)
        cosine = abs(np.cos(pitch))
        bound, between = known_to(of, cosine)
        # Roll is held from a cosine of two units on, give or take what an element is off; then it, and heading with
        # it, are as good as they were before.
        if cosine < unit:
            assert angles[0] == before[0]
        if cosine < 3 * unit and angles[0] == before[0] and last is not None:
            bound[[0, 2]] = last[0], last[0] + between
        assert np.all(apart(angles, [roll, pitch, heading]) <= bound)
        assert apart(angles[2] - sign * angles[0], heading - sign * roll) <= between
        if last is not None:
            # Only pitch has moved.
            assert np.all(apart(angles - before, [0, pitch - last_pitch, 0]) <= bound + last)
        before, last, last_pitch = angles, bound, pitch


@pytest.mark.long
@pytest.mark.parametrize("sign", [1, -1])
def test_the_attitude_is_continuous_through_vertical_pitch(sign, backend_name):
    # A loop: pitch passes 90 degrees, roll and heading turn over by half a turn there, the attitude does not.
    to = kernels()[0]
    of = strapgen.evaluator("euler-angles-from-dcm", backend_name)
    start = np.array([0.4, 0.0, -1.2])
    before = start.astype(of.dtype)
    for pitch in np.radians(np.arange(80, 100.001, 0.125)):
        matrix = to(start + np.array([0, sign * pitch, 0]))
        angles = np.asarray(of(matrix, before.astype(of.dtype)), float)
        cosine = abs(np.cos(pitch))
        bound, between = known_to(of, cosine)
        # Errors of pitch, of the angle between or together, and, as far as pitch is not vertical, of roll.
        assert np.abs(to(angles) - matrix).max() <= bound[1] + between + cosine * bound[0] + 4 * EPS
        assert apart(angles[2] - sign * angles[0], start[2] - sign * start[0]) <= between
        if cosine > 1e-9:
            over = pitch > np.pi / 2
            level = sign * (np.pi - pitch if over else pitch)
            turned = np.array([np.pi, 0, np.pi]) * over
            # The cosine itself is off by a last place of the angle.
            bound[[0, 2]] += 4 * EPS / cosine
            assert np.all(apart(angles, start + np.array([0, level, 0]) + turned) <= bound)
        else:
            assert angles[0] == before[0]
        before = angles


def test_elements_beyond_one_do_no_harm():
    # Round-off may make |C31| greater than 1: the root is of other elements.
    matrix = np.array([[0.0, -1, 0], [0, 0, 1], [-1 - 4 * EPS, 0, 0]])
    angles = kernels()[1](matrix, [0.5, 0, 0])
    assert np.isfinite(angles).all() and angles[0] == 0.5
    assert angles[1] == np.pi / 2


RULES = {"euler-from-dcm-sheppard": 60, "euler-from-dcm-continuous": 180}


def turns(count: int, largest: float, rng: np.random.Generator) -> Rotation:
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    return Rotation.from_rotvec(np.radians(largest) * (1 - rng.random((count, 1)) ** 4) * axes)


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("backend", ["numpy", "c"])
@pytest.mark.parametrize("count", [20_000, pytest.param(200_000, marks=pytest.mark.long)])
def test_round_trips_and_signs(name, backend, count, rng):
    # From one attitude to another by any turn below the limit; quarter and half turns among the attitudes.
    special = np.array([q for q in product((-1, 0, 1), repeat=4) if any(q)], float)
    start = Rotation.from_quat(np.concatenate([special, rng.normal(size=(count - len(special), 4))]))
    end = start * turns(count, RULES[name] - 0.001, rng)
    before = start.as_quat()
    wanted = end.as_quat()
    wanted *= np.where((wanted * before).sum(axis=-1) < 0, -1, 1)[:, None]
    made = strapgen.evaluator(name, backend)(end.as_matrix(), before)
    assert np.abs(made - wanted).max() <= 4 * EPS
    # What half a last place of each parameter makes of the matrix, and 4 last places.
    rounding = np.abs(made).sum(axis=-1) * np.spacing(np.abs(made)).max(axis=-1)
    back = strapgen.evaluator("dcm-from-euler", backend)(made)
    assert np.all(np.abs(back - end.as_matrix()).max(axis=(-2, -1)) <= rounding + 4 * EPS)


def quaternion_corners() -> np.ndarray:
    """Return the parameters of all quarter turns about three axes in turn, and of half turns about axes between."""
    quarters = Rotation.from_euler("ZYX", list(product((-90, 0, 90, 180), repeat=3)), degrees=True).as_quat()
    axes = np.array([axis for axis in product((-1, 0, 1), repeat=3) if any(axis)] + [(1, 2, -2)], float)
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    return np.concatenate([quarters, np.column_stack([axes, np.zeros(len(axes))])])


def parameters_known_to(backend_name: str) -> float:
    """Return the bound of the rounding of parameters whose sign is told.

    A parameter is no worse than the matrix: half a unit of each element is one of a parameter. In fixed point the
    arithmetic is certified; both rules have the same but for the sign, and the one that compares a number with zero as
    it was given cannot turn the sign over.
    """
    return one_call(strapgen.evaluator("euler-from-dcm-sheppard", backend_name), 4)


@pytest.mark.parametrize("name", RULES)
def test_quarter_and_half_turns(name, backend_name):
    # Where parameters are equal in size, or the scalar is zero, the sign is still that of the call before.
    ends = quaternion_corners()
    assert len(ends) == 64 + 27
    matrices = Rotation.from_quat(ends).as_matrix()
    convert = strapgen.evaluator(name, backend_name)
    allowed = parameters_known_to(backend_name)
    for sign in (1, -1):
        made = np.asarray(convert(matrices.astype(convert.dtype), (sign * ends).astype(convert.dtype)), float)
        assert np.abs(made - sign * ends).max() <= allowed
        # The matrix is quadratic in the parameters: an error of each stands there twice, times the others.
        rounding = 2 * np.abs(made).sum(axis=-1) * allowed
        if allowed <= 4 * EPS:
            rounding = np.abs(made).sum(axis=-1) * np.spacing(np.abs(made)).max(axis=-1)
        back = strapgen.evaluator("dcm-from-euler")(made)
        assert np.all(np.abs(back - matrices).max(axis=(-2, -1)) <= rounding + 4 * EPS)


@pytest.mark.parametrize(("first", "turn", "holds"), [(-1e-3, 60.56, False), (0.01, 59.83, True)])
def test_the_rule_of_the_largest_element_holds_to_60_degrees(first, turn, holds, backend_name):
    # The parameters are next to equal now, the first one the largest; 60 degrees before it was zero.
    before, after = np.array([first, 1, 1, 1]), np.array([1.01, 1, 1, 1])
    before, after = before / np.linalg.norm(before), after / np.linalg.norm(after)
    assert 2 * np.degrees(np.arccos(before @ after)) == pytest.approx(turn, abs=0.005)
    matrix = Rotation.from_quat(after).as_matrix()
    for name, sign in (("euler-from-dcm-sheppard", 1 if holds else -1), ("euler-from-dcm-continuous", 1)):
        convert = strapgen.evaluator(name, backend_name)
        made = np.asarray(convert(matrix.astype(convert.dtype), before.astype(convert.dtype)), float)
        assert np.abs(made - sign * after).max() <= parameters_known_to(backend_name)


def test_the_rule_of_the_largest_element_fails_for_some_turns_of_100_degrees(rng):
    start = Rotation.random(20_000, rng=rng)
    end = start * turns(20_000, 100, rng)
    made = strapgen.evaluator("euler-from-dcm-sheppard")(end.as_matrix(), start.as_quat())
    assert ((made * start.as_quat()).sum(axis=-1) < 0).any()
    made = strapgen.evaluator("euler-from-dcm-continuous")(end.as_matrix(), start.as_quat())
    assert ((made * start.as_quat()).sum(axis=-1) >= 0).all()


def test_zero_counts_as_plus():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for name in RULES:
        made = strapgen.evaluator(name)(quarter, np.zeros(4))
        np.testing.assert_allclose(np.abs(made), [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=EPS)
        assert made[3] > 0 or made[2] > 0
