"""Terms of a sum at one place: the nearest integers, and bounds that hold."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.fixedpoint.quantities import Placed, aligned, largest_wide, nearest, up
from strapgen.ir.integer_program import Term

numbers = st.fractions(min_value=-100, max_value=100, max_denominator=10**4)
SETTINGS = settings(derandomize=True, database=None, deadline=None, max_examples=25)


@SETTINGS
@given(numbers)
def test_the_nearest_integer_is_at_most_half_a_unit_away_and_halves_go_up(value):
    assert -Fraction(1, 2) < nearest(value) - value <= Fraction(1, 2)
    assert [nearest(Fraction(n, 2)) for n in (-3, -1, 1, 3)] == [-1, 0, 1, 2]


@SETTINGS
@given(numbers)
def test_a_bound_is_rounded_up_by_less_than_what_a_word_can_tell(value):
    assert value <= up(value) < value + Fraction(1, 2**100)


@SETTINGS
@given(st.integers(-(10**4), 10**4), st.integers(0, 20), st.integers(0, 20))
def test_a_constant_at_a_coarser_place_is_rounded_and_its_error_is_told(factor, place, dropped):
    exact = Fraction(factor, 2 ** (place + dropped))
    total = aligned([Placed(Term((), factor), place + dropped, Fraction(1, 8))], place, 32, {})
    written = sum(term.factor * Fraction(2) ** (term.shift - place) for term in total.terms)
    assert (
        abs(written - exact)
        <= total.error - Fraction(1, 8)
        <= Fraction(1, 2 ** (place + 1)) + Fraction(1, 2**100)
    )
    assert total.peak == sum(abs(term.factor) for term in total.terms)


def test_a_wide_number_holds_two_words():
    assert [largest_wide(word) for word in (8, 16, 32)] == [2**15 - 1, 2**31 - 1, 2**63 - 1]
