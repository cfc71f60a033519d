"""Rate extraction: exact on polynomial rates, and the printed formulas."""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from peano_baker import Series, angle, generic_rate, lowest_difference, rotation, true_rotation

from strapgen.catalogue import MOST_INCREMENTS
from strapgen.catalogue.methods.rate_fit import Fit, from_increments, from_rates, step_order
from strapgen.catalogue.methods.rotation_series import magnus

RATIONALS = st.fractions(min_value=-3, max_value=3, max_denominator=20)


def integral(coefficients: list[Fraction], t: Fraction) -> Fraction:
    """Return the integral from 0 to t of the rate sum_k coefficients[k] t^k."""
    return sum((c * t ** (k + 1) / (k + 1) for k, c in enumerate(coefficients)), Fraction(0))


#: Most increments from before the step in these tests; more of them show nothing new.
FEW_PREVIOUS = 3


def rate(coefficients: list[Fraction], t: Fraction) -> Fraction:
    return sum((c * t**k for k, c in enumerate(coefficients)), Fraction(0))


def extracted(coefficients: list[Fraction], count: int, node: Fraction, h: Fraction) -> Fraction:
    """Return the rate at node h that the increments of a step of length h give."""
    samples = [integral(coefficients, h * k / count) for k in range(count + 1)]
    increments = [after - before for before, after in pairwise(samples)]
    weights = [Fraction(int(w.p), int(w.q)) for w in from_increments(count).at(node)]
    return sum((w * d for w, d in zip(weights, increments, strict=True)), Fraction(0)) / h


@pytest.mark.parametrize(
    ("node", "printed"), [(Fraction(0), (3, -1)), (Fraction(1, 2), (1, 1)), (Fraction(1), (-1, 3))]
)
def test_two_increments_give_the_printed_formulas(node, printed):
    assert tuple(from_increments(2).at(node)) == printed


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


# With previous increments


def samples(coefficients: list[Fraction], count: int, previous: int) -> list[Fraction]:
    """Return the increments of a step of length 1 from time 0, and those before it."""
    angles = [integral(coefficients, Fraction(k, count)) for k in range(-previous, count + 1)]
    return [after - before for before, after in pairwise(angles)]


def weighed(weights: list[sp.Rational], values: list[Fraction]) -> Fraction:
    return sum((Fraction(int(w.p), int(w.q)) * v for w, v in zip(weights, values, strict=True)), Fraction(0))


def exactly(value: Fraction) -> sp.Rational:
    return sp.Rational(value.numerator, value.denominator)


def midpoint_moment(k: int, power: int) -> Fraction:
    """Return the integral of t^k (t - 1/2)^power over the step, with t = u + 1/2: odd powers of u vanish."""
    return sum(
        (
            math.comb(k, j)
            * Fraction(1, 2) ** (k - j)
            * Fraction(2, j + power + 1)
            * Fraction(1, 2) ** (j + power + 1)
            for j in range(k + 1)
            if (j + power) % 2 == 0
        ),
        Fraction(0),
    )


COUNTS = st.tuples(st.integers(1, MOST_INCREMENTS), st.integers(0, FEW_PREVIOUS))
POLYNOMIALS = COUNTS.flatmap(
    lambda counts: st.tuples(st.just(counts), st.lists(RATIONALS, min_size=sum(counts), max_size=sum(counts)))
)


@pytest.mark.long
@settings(derandomize=True, database=None, deadline=None, max_examples=25)
@given(case=POLYNOMIALS, node=RATIONALS, power=st.integers(0, 4))
def test_k_and_m_increments_are_exact_on_rates_of_degree_k_plus_m_minus_1(case, node, power):
    (count, previous), coefficients = case
    fit, given_ = from_increments(count, previous), samples(coefficients, count, previous)
    assert weighed(fit.at(node), given_) == rate(coefficients, node)
    for k, coefficient in enumerate(coefficients):
        assert weighed(fit.taylor(k), given_) == coefficient
    expected = sum((c * midpoint_moment(k, power) for k, c in enumerate(coefficients)), Fraction(0))
    assert weighed(fit.moment(power), given_) == expected


@pytest.mark.parametrize("previous", range(FEW_PREVIOUS + 1))
@pytest.mark.parametrize("count", range(1, MOST_INCREMENTS + 1))
def test_the_integral_of_the_rate_is_the_sum_of_the_increments_of_the_step(count, previous):
    assert from_increments(count, previous).moment(0) == [0] * previous + [1] * count


def test_previous_increments_give_the_formulas_of_backward_differences():
    # f'(0) and f'(1) of the parabola through f(-1), f(0), f(1).
    fit, half = from_increments(1, previous=1), sp.Rational(1, 2)
    assert fit.at(Fraction(0)) == [half, half]
    assert fit.at(Fraction(1)) == [-half, 3 * half]


# Rates at nodes


@pytest.mark.long
@settings(derandomize=True, database=None, deadline=None, max_examples=25)
@given(
    data=st.lists(st.tuples(RATIONALS, RATIONALS), min_size=1, max_size=6, unique_by=lambda pair: pair[0]),
    node=RATIONALS,
)
def test_rates_at_nodes_are_exact_on_polynomials_of_their_degree(data, node):
    nodes, coefficients = zip(*data, strict=True)
    fit, given_ = from_rates(nodes), [rate(coefficients, node) for node in nodes]
    assert weighed(fit.at(node), given_) == rate(coefficients, node)
    for place, own in enumerate(nodes):
        assert fit.at(own) == [int(k == place) for k in range(len(nodes))]


@pytest.mark.long
@pytest.mark.parametrize("count", [1, 2, 3])
def test_rates_at_the_nodes_of_gauss_give_moments_to_twice_their_number(count):
    # Gauss's quadrature: with n nodes exact to degree 2 n - 1, here of the rate times (t - 1/2)^power, t in steps.
    fit: Fit = from_rates(magnus(2 * count).nodes)
    half = sp.Rational(1, 2)
    for power in range(count):
        for degree in range(2 * count - power):
            given_ = [node**degree for node in magnus(2 * count).nodes]
            found = sum(w * x for w, x in zip(fit.moment(power), given_, strict=True))
            t = sp.Symbol("t")
            assert sp.expand(found - sp.integrate(sp.expand(t**degree * (t - half) ** power), (t, 0, 1))) == 0
    missed = sum(
        w * node ** (2 * count) for w, node in zip(fit.moment(0), magnus(2 * count).nodes, strict=True)
    )
    assert sp.expand(missed - sp.Rational(1, 2 * count + 1)) != 0


# The order of a step from increments alone


def fitted_rate(rate_: list, count: int, previous: int, top: int) -> list[list[Series]]:
    """Return the polynomial, times the step, through the samples of an integrated rate: by Lagrange, from scratch."""
    t = sp.Symbol("t")
    times = [Fraction(k, count) for k in range(-previous, count + 1)]
    fitted = [[Series({}, top)] * 3 for _ in times[1:]]
    for own in times:
        others = [exactly(other) for other in times if other != own]
        cardinal = sp.prod([(t - other) / (exactly(own) - other) for other in others])
        slope = sp.Poly(cardinal, t).diff().all_coeffs()[::-1]
        reached = angle(rate_, Fraction(0), own, top)
        for k, c in enumerate(slope):
            weight = Fraction(int(c.p), int(c.q))
            fitted[k] = [total + x * weight for total, x in zip(fitted[k], reached, strict=True)]
    return fitted


@pytest.mark.long
@pytest.mark.parametrize("previous", range(FEW_PREVIOUS + 1))
@pytest.mark.parametrize("count", range(1, 6))
def test_the_step_order_is_that_of_the_exact_rotation_of_the_fitted_rate(count, previous):
    # The rate has one degree more than the fit, and in a second run two more: all that the error can begin with.
    order = step_order(count, previous)
    for degree in (count + previous, count + previous + 1):
        true = generic_rate(degree)
        found = rotation("euler", fitted_rate(true, count, previous, order + 1), order + 1)
        assert lowest_difference(found, true_rotation("euler", true, order + 1)) == order + 1


def test_step_orders_as_the_literature_has_them():
    # Even numbers of increments gain two orders, as closed Newton-Cotes rules do; odd ones, or with history, one.
    assert [step_order(count) for count in range(1, MOST_INCREMENTS + 1)] == [2, 4, 4, 6, 6, 8, 8, 10]
    for count in range(1, MOST_INCREMENTS + 1):
        for previous in range(1, FEW_PREVIOUS + 1):
            assert step_order(count, previous) == count + previous + 1
