"""Euler parameters of a matrix whose sign is that of the call before."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapgen

EPS = 2.0**-52
RULES = {"euler-from-dcm-sheppard": 60, "euler-from-dcm-continuous": 180}


def turns(count: int, largest: float, rng: np.random.Generator) -> Rotation:
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    return Rotation.from_rotvec(np.radians(largest) * (1 - rng.random((count, 1)) ** 4) * axes)


@pytest.mark.parametrize("name", RULES)
@pytest.mark.parametrize("backend", ["numpy", "c"])
@pytest.mark.parametrize("count", [20_000, pytest.param(1_000_000, marks=pytest.mark.long)])
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


def test_the_rule_of_the_largest_element_fails_beyond_its_limit(rng):
    start = Rotation.random(20_000, rng=rng)
    end = start * Rotation.from_rotvec(np.radians(61) * np.array([1, 0, 0]))
    end_of_others = start * turns(20_000, 100, rng)
    for after, least in ((end, 0), (end_of_others, 1)):
        made = strapgen.evaluator("euler-from-dcm-sheppard")(after.as_matrix(), start.as_quat())
        assert ((made * start.as_quat()).sum(axis=-1) < 0).sum() >= least
        made = strapgen.evaluator("euler-from-dcm-continuous")(after.as_matrix(), start.as_quat())
        assert ((made * start.as_quat()).sum(axis=-1) >= 0).all()


def test_zero_counts_as_plus():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for name in RULES:
        made = strapgen.evaluator(name)(quarter, np.zeros(4))
        np.testing.assert_allclose(np.abs(made), [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=EPS)
        assert made[3] > 0 or made[2] > 0


def test_a_slow_turn_keeps_its_sign_over_two_turns(backend_name):
    angles = np.linspace(0, 4 * np.pi, 200)
    axis = np.array([2, -1, 2]) / 3
    for name in RULES:
        convert = strapgen.evaluator(name, backend_name)
        before = np.array([0.0, 0, 0, 1])
        for angle in angles:
            matrix = Rotation.from_rotvec(angle * axis).as_matrix()
            before = np.asarray(convert(matrix, before), float)
            wanted = np.array([*(np.sin(angle / 2) * axis), np.cos(angle / 2)])
            assert np.abs(before - wanted).max() <= 1e-3
        assert before[3] == pytest.approx(1, abs=1e-3)
