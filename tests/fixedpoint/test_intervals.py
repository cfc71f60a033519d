"""Intervals hold every result of their operations."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.fixedpoint.intervals import Interval, maximum

numbers = st.fractions(min_value=-100, max_value=100, max_denominator=10**6)


@st.composite
def intervals_with_members(draw):
    low, high = sorted((draw(numbers), draw(numbers)))
    part = draw(st.fractions(min_value=0, max_value=1, max_denominator=1000))
    return Interval.of(low, high), low + part * (high - low)


@given(intervals_with_members(), intervals_with_members(), numbers)
def test_sums_products_and_multiples(one, other, factor):
    (a, x), (b, y) = one, other
    assert x in a and y in b
    assert x + y in a + b
    assert x - y in a - b
    assert x * y in a * b
    assert -x in -a
    assert factor * x in a.scale(factor)
    assert x * x in a.square()
    assert a.square().low >= 0
    assert max(x, y) in maximum([a, b])
    assert x in a.join(b) and y in a.join(b)
    assert abs(x) <= a.magnitude
    assert x + abs(factor) in a.widened(abs(factor))
    lower, upper = a.halves()
    assert x in lower or x in upper


@given(intervals_with_members())
def test_roots_and_reciprocals(one):
    a, x = one
    if a.low >= 0:
        root = a.sqrt()
        assert root.lowest**2 <= x <= root.highest**2
        # Tight to the grid: neither end is off by more than a unit of it.
        assert Fraction(root.low + 1, 1) ** 2 > Fraction(a.low) * 2**160 or root.low == 0
    else:
        with pytest.raises(ValueError, match="square root"):
            a.sqrt()
    if a.low > 0 or a.high < 0:
        assert 1 / x in a.reciprocal()
    else:
        with pytest.raises(ValueError, match="division"):
            a.reciprocal()


def test_ends_are_rounded_outward():
    third = Interval.of(Fraction(1, 3))
    assert third.lowest < Fraction(1, 3) < third.highest
    assert third.high - third.low == 1
    assert math.isclose(float(third.lowest), 1 / 3)
    root = Interval.of(2).sqrt()
    assert root.lowest**2 < 2 < root.highest**2
    assert root.high - root.low == 1
