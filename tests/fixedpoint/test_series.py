"""Truncated series: whatever the variables are inside their sizes, the value lies within the bound."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.fixedpoint.series import Series, Truncated

SIZES = [Fraction(1, 3), Fraction(3, 2), Fraction(1, 50)]
COEFFICIENTS = st.fractions(min_value=-3, max_value=3, max_denominator=60)


def at(series: Series, values: list[Fraction]) -> Fraction:
    """Return the polynomial of a series without its rest."""
    total = Fraction(0)
    for part in series.terms.values():
        for places, coefficient in part.items():
            product = Fraction(coefficient, 1 << 192)
            for place in places:
                product *= values[place]
            total += product
    return total


@settings(derandomize=True, database=None, deadline=None, max_examples=25)
@given(
    data=st.lists(
        st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=12
    ),
    constants=st.lists(COEFFICIENTS, min_size=4, max_size=4),
    parts=st.lists(st.fractions(min_value=-1, max_value=1, max_denominator=9), min_size=3, max_size=3),
    most=st.sampled_from([4, 10, 20, 84]),
)
def test_any_chain_of_operations_is_enclosed(data, constants, parts, most):
    """Each operation takes two of the last values, on the series and on exact numbers."""
    arithmetic = Truncated(SIZES, most)
    values = [part * size for part, size in zip(parts, SIZES, strict=True)]
    series = [arithmetic.variable(k) for k in range(3)] + [arithmetic.constant(constants[0])]
    exact = [*values, constants[0]]
    for kind, first, second in data:
        a, b = series[-1 - first], series[-1 - second]
        x, y = exact[-1 - first], exact[-1 - second]
        made, wanted = {
            0: (arithmetic.sum(a, b), x + y),
            1: (arithmetic.less(a, b), x - y),
            2: (arithmetic.product(a, b), x * y),
            3: (arithmetic.dot([a, b], [b, a]), 2 * x * y),
        }[kind]
        series.append(made)
        exact.append(wanted)
        assert abs(at(made, values) - wanted) <= made.rest
        assert abs(wanted) <= arithmetic.size(made)
        assert all(degree <= arithmetic.degree for degree in made.terms)


def test_what_fits_is_exact_and_cancels():
    arithmetic = Truncated([Fraction(1, 10)] * 2, 15)
    x, y = arithmetic.variable(0), arithmetic.variable(1)
    one = arithmetic.sum(arithmetic.product(x, x), arithmetic.product(x, y))
    other = arithmetic.product(x, arithmetic.sum(x, y))
    assert arithmetic.less(one, other).terms == {}
    assert arithmetic.size(arithmetic.less(one, other)) < Fraction(1, 10**50)  # the rounding of coefficients


@pytest.mark.parametrize(
    ("count", "most", "degree"), [(3, 1000, 16), (6, 1000, 6), (9, 1000, 4), (24, 1000, 2)]
)
def test_the_degree_is_the_largest_whose_terms_are_few(count, most, degree):
    assert Truncated([Fraction(1)] * count, most).degree == degree


def test_what_is_cut_off_is_in_the_rest():
    arithmetic = Truncated([Fraction(1, 2)], 3)  # to the second power
    x = arithmetic.variable(0)
    square = arithmetic.product(x, x)
    cube = arithmetic.product(square, x)
    assert cube.terms == {}
    assert 0 <= cube.rest - Fraction(1, 8) < Fraction(1, 10**50)
