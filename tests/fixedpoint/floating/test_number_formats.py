"""The formats of floating-point numbers: rounding as literals are read, and the errors of rounding."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.fixedpoint.floating.errors import NUMBERS
from strapgen.targets.c import DOUBLE, FLOAT, CPrinter

TYPES = {"double": (np.float64, DOUBLE), "float": (np.float32, FLOAT)}
RATIONALS = st.fractions(min_value=-8, max_value=8, max_denominator=10**9)


@pytest.mark.parametrize("number", NUMBERS)
@given(value=RATIONALS)
def test_a_literal_is_rounded_as_it_is_printed(number, value):
    type_, real = TYPES[number]
    text = CPrinter(real).constant(value).removesuffix("f")
    assert NUMBERS[number].rounded(value) == Fraction(float(type_(text)))


@pytest.mark.parametrize("number", NUMBERS)
def test_the_smallest_numbers_are_those_of_the_type(number):
    type_, _ = TYPES[number]
    format_, information = NUMBERS[number], np.finfo(type_)
    assert Fraction(float(information.smallest_subnormal)) == Fraction(2) ** format_.smallest
    assert Fraction(float(information.eps)) == 2 * format_.unit
    assert format_.rounded(format_.underflow) == 0 != format_.rounded(3 * format_.underflow)


@pytest.mark.parametrize("number", NUMBERS)
@given(largest=RATIONALS.map(abs), part=st.fractions(min_value=0, max_value=1, max_denominator=10**6))
def test_no_number_up_to_the_largest_is_rounded_by_more_than_half_an_ulp(number, largest, part):
    format_ = NUMBERS[number]
    value = largest * part
    for near in (value, value + format_.unit * value / 2, largest):
        if near <= largest:
            assert abs(format_.rounded(near) - near) <= format_.half_ulp(largest)


def test_half_an_ulp_is_attained_below_above_and_just_above_a_power_of_two():
    format_ = NUMBERS["float"]
    unit = format_.unit
    for largest, worst in [
        (Fraction(1), 1 - unit / 2),
        (Fraction(3, 2), 1 + unit),
        (1 + unit * 3 / 4, 1 + unit * 3 / 4),
    ]:
        assert worst <= largest
        assert abs(format_.rounded(worst) - worst) == format_.half_ulp(largest)
