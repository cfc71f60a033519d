"""Ranges of integers that are checked when the code runs, and what is taken as exact because nothing is known of it."""

from __future__ import annotations

from fractions import Fraction

import pytest
from small_integers import Known, context, quantity

from strapgen.fixedpoint.integer_sums import integer_value
from strapgen.fixedpoint.quantities import Sum
from strapgen.ir.exceptions import InputError
from strapgen.ir.integer_program import IntegerSum, Term


@pytest.mark.parametrize("sign", [1, -1])
def test_what_passes_a_check_stands_for_an_exact_value_inside_the_range(sign):
    low, high = sorted((sign * Fraction(1, 3), sign * Fraction(9, 5)))
    error, followed, approximation_error, places = Fraction(1, 40), Fraction(1, 70), Fraction(1, 90), 5
    item = quantity(
        "y",
        Sum(((("a",), Fraction(1)),)),
        low,
        high,
        range_checked=True,
        approximation_error=approximation_error,
    )
    walk = context({"a": Known(5, -80, 80)}, item)
    value = integer_value(walk, item, IntegerSum((Term(("a",), 1),)), places, error, 80, followed=followed)
    off = error + followed + approximation_error
    assert value.range_checked

    def surely_inside(integer: int) -> bool:
        return low <= Fraction(integer, 32) - off and Fraction(integer, 32) + off <= high

    # All that surely are inside pass, and no other.
    passing = [integer for integer in range(-80, 81) if surely_inside(integer)]
    assert (value.low, value.high) == (passing[0], passing[-1])


def test_an_error_of_half_the_smaller_end_is_the_largest_that_a_check_allows():
    low, high = Fraction(1, 2), Fraction(2)
    item = quantity("y", Sum(((("a",), Fraction(1)),)), low, high, range_checked=True)
    walk = context({"a": Known(5, 0, 80)}, item)

    def value(error):
        return integer_value(walk, item, IntegerSum((Term(("a",), 1),)), 5, error, 80)

    assert (value(low / 2).low, value(low / 2).high) == (24, 56)
    with pytest.raises(InputError, match="too short for y, its error may be as large as itself"):
        value(low / 2 + Fraction(1, 1 << 100))
