"""Products of exponentials: of third order, and rotations whatever the increments are."""

from __future__ import annotations

from fractions import Fraction

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
