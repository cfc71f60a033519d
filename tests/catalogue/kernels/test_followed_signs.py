"""Euler parameters of a matrix whose sign is that of the call before."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tolerances import one_call

import strapgen

EPS = 2.0**-52
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


def corners() -> np.ndarray:
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
    ends = corners()
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
