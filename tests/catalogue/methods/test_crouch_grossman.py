"""Products of exponentials: of third order, and rotations whatever the increments are."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.catalogue.methods.runge_kutta import _NODES, _WEIGHTS


def test_the_coefficients_meet_the_conditions_of_third_order_in_time():
    for power in range(3):
        total = sum((w * c**power for w, c in zip(_WEIGHTS, _NODES, strict=True)), Fraction(0))
        assert total == Fraction(1, power + 1)


def test_the_coefficients_meet_the_condition_of_the_order_of_the_exponentials():
    """The commutators of the product are those of the Magnus series: sum_(i<j) b_i b_j (c_j - c_i) is 1/6."""
    nodes = range(len(_NODES))
    total = sum(
        (_WEIGHTS[i] * _WEIGHTS[j] * (_NODES[j] - _NODES[i]) for i in nodes for j in nodes if i < j),
        Fraction(0),
    )
    assert total == Fraction(1, 6)


@pytest.mark.long
def test_a_constant_rate_is_integrated_exactly():
    turn = np.tile([0.3, -0.4, 0.5], (1, 2, 1)) / 2
    state = strapgen.backend("euler", "crouch-grossman3", 2).propagate(turn)[-1]
    angle = np.linalg.norm([0.3, -0.4, 0.5])
    expected = [*(np.array([0.3, -0.4, 0.5]) / angle * np.sin(angle / 2)), np.cos(angle / 2)]
    np.testing.assert_allclose(state, expected, atol=1e-15)


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ["euler", pytest.param("dcm", marks=pytest.mark.long)])
def test_the_observed_order_is_the_predicted_one(algorithm):
    motion = strapgen.motion("coning", a_rad_s=1, b_rad_s=1.5, g_rad_s=0.6)
    choice = strapgen.choose(algorithm, "crouch-grossman3", 3)
    order = strapgen.converge(choice, motion, ["1/8", "1/16", "1/32"], 1, "numpy")
    assert order.predicted == 3
    assert order.observed == pytest.approx(3, abs=0.1)
