"""Rate extraction: exact on polynomial rates, and the printed formulas."""

from fractions import Fraction
from itertools import pairwise

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.catalogue import MOST_INCREMENTS
from strapgen.catalogue.rates import from_increments

RATIONALS = st.fractions(min_value=-3, max_value=3, max_denominator=20)


def angle(coefficients: list[Fraction], t: Fraction) -> Fraction:
    """Return the integral from 0 to t of the rate sum_k coefficients[k] t^k."""
    return sum((c * t ** (k + 1) / (k + 1) for k, c in enumerate(coefficients)), Fraction(0))


def rate(coefficients: list[Fraction], t: Fraction) -> Fraction:
    return sum((c * t**k for k, c in enumerate(coefficients)), Fraction(0))


def extracted(coefficients: list[Fraction], count: int, node: Fraction, h: Fraction) -> Fraction:
    """Return the rate at node h that the increments of a step of length h give."""
    samples = [angle(coefficients, h * k / count) for k in range(count + 1)]
    increments = [after - before for before, after in pairwise(samples)]
    weights = [Fraction(int(w.p), int(w.q)) for w in from_increments(count).at(node)]
    return sum((w * d for w, d in zip(weights, increments, strict=True)), Fraction(0)) / h


@pytest.mark.parametrize(
    ("node", "printed"), [(Fraction(0), (3, -1)), (Fraction(1, 2), (1, 1)), (Fraction(1), (-1, 3))]
)
def test_two_increments_give_the_printed_formulas(node, printed):
    assert tuple(from_increments(2).at(node)) == printed


@settings(derandomize=True, database=None, deadline=None)
@given(node=RATIONALS)
def test_one_increment_gives_a_constant_rate(node):
    assert from_increments(1).at(node) == [1]


@settings(derandomize=True, database=None, deadline=None)
@given(
    coefficients=st.integers(1, MOST_INCREMENTS).flatmap(
        lambda count: st.lists(RATIONALS, min_size=count, max_size=count)
    ),
    node=RATIONALS,
    h=st.fractions(min_value=Fraction(1, 50), max_value=5, max_denominator=50),
)
def test_k_increments_are_exact_on_rates_of_degree_k_minus_1(coefficients, node, h):
    assert extracted(coefficients, len(coefficients), node, h) == rate(coefficients, node * h)


@pytest.mark.parametrize("count", range(1, MOST_INCREMENTS + 1))
def test_every_count_is_exact_at_the_nodes_of_the_methods(count):
    coefficients = [Fraction((-1) ** k * (k + 2), k + 1) for k in range(count)]
    for node in (Fraction(0), Fraction(1, 2), Fraction(1)):
        assert extracted(coefficients, count, node, Fraction(1, 8)) == rate(coefficients, node / 8)


@pytest.mark.parametrize("count", range(1, MOST_INCREMENTS + 1))
def test_an_irrational_node_is_exact_too(count):
    node = sp.Rational(1, 2) + sp.sqrt(21) / 14
    coefficients = [sp.Rational((-1) ** k * (k + 2), k + 1) for k in range(count)]
    angles = [
        sum(c * sp.Rational(j, count) ** (k + 1) / (k + 1) for k, c in enumerate(coefficients))
        for j in range(count + 1)
    ]
    increments = [after - before for before, after in pairwise(angles)]
    found = sum(w * d for w, d in zip(from_increments(count).at(node), increments, strict=True))
    assert sp.expand(found - sum(c * node**k for k, c in enumerate(coefficients))) == 0


@pytest.mark.parametrize("count", range(1, MOST_INCREMENTS + 1))
def test_k_increments_are_not_exact_on_degree_k(count):
    # At a sample the derivative of the interpolation's remainder is not zero.
    coefficients = [Fraction(0)] * count + [Fraction(1)]
    assert extracted(coefficients, count, Fraction(0), Fraction(1)) != rate(coefficients, Fraction(0))
