"""Canonical signed digits: they stand for their number, no two are neighbours, and those that are kept are nearest."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from strapgen.ir.formats import from_digits, signed_digits


@given(st.integers(-(1 << 63), 1 << 63))
def test_digits_stand_for_their_number_and_no_two_are_neighbours(value):
    digits = signed_digits(value)
    assert from_digits(digits) == value
    powers = [power for _, power in digits]
    assert all(above - below > 1 for above, below in pairwise(powers))
    # A number of n bits has no more than half of n + 1 digits.
    assert len(digits) <= (abs(value).bit_length() + 2) // 2


@given(st.integers(-(1 << 31), 1 << 31), st.integers(1, 8))
def test_what_is_cut_off_is_at_most_two_thirds_of_the_next_digit(value, most):
    digits = signed_digits(value)
    cut = signed_digits(value, most)
    assert cut == digits[:most]
    left = abs(value - from_digits(cut))
    assert left == 0 or 3 * left < 2 * 2 ** (digits[most][1] + 1)
