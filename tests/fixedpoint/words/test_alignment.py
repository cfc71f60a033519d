"""Formats that are coarser where the sums that use a value cannot tell: how many bits, and of which values."""

from __future__ import annotations

from fractions import Fraction

import pytest

from strapgen.fixedpoint.quantization import aligning
from strapgen.ir.integer_program import IntegerOperation, IntegerSum, Scaled, Term, Value
from strapgen.ir.interfaces import ErrorFeedback

ZERO = Fraction(0)


def value(name: str, definition, fraction: int, magnitude: int) -> Value:
    return Value(name, definition, fraction, False, -magnitude, magnitude, ZERO, ZERO, magnitude)


def names_and_bits(*body: Value, fixed: tuple[str, ...] = ()) -> dict[str, int]:
    """Return by how many bits values may be coarser; the input s has 4 fraction bits and stays below 1."""
    inputs = value("s", None, 4, 16)
    values = {item.name: item for item in (inputs, *body)}
    return {name: values[name].fraction - most for name, most in aligning(body, values, fixed).items()}


@pytest.mark.parametrize("drop", [0, 3, 8])
def test_error_feedback_that_is_coarser_than_a_sum_changes_no_place(drop):
    """The places below the feedback are dropped first, and belong to the sum all the same."""
    # a s ends at place 28, c at place 16, which is 8 bits below the result: of these 12 bits, an error of a that
    # s is multiplied with may add a sixteenth of a unit of the feedback, which is 4 bits finer than the result.
    a = value("a", IntegerSum((Term(("s",), 1),), 4), 24, 1 << 24)
    c = value("c", None, 16, 1 << 10)
    feedback = ErrorFeedback("r", 0, 20, 0)
    total = IntegerSum((Term(("a", "s"), 1), Term(("c",), 1, 12)), 20 - drop, (), feedback, drop)
    assert names_and_bits(a, c, value("y", total, 8, 1 << 8)) == {"a": 8}


def test_values_of_which_every_bit_counts_stay_as_they_are():
    a = value("a", IntegerSum((Term(("s",), 1),), 4), 24, 1 << 24)
    c = value("c", None, 16, 1 << 10)
    total = IntegerSum((Term(("a", "s"), 1), Term(("c",), 1, 12)), 20)
    y = value("y", total, 8, 1 << 8)
    assert names_and_bits(a, c, y) == {"a": 12}
    assert names_and_bits(a, c, y, fixed=("a",)) == {}
    larger = IntegerOperation("maximum", (Scaled("a"), Scaled("a", 1)))
    assert names_and_bits(a, c, y, value("z", larger, 24, 1 << 25)) == {}


def test_a_factor_of_what_is_always_zero_has_any_format():
    a = value("a", IntegerSum((Term(("s",), 1),), 4), 24, 1 << 24)
    c, nothing = value("c", None, 16, 1 << 10), value("n", None, 4, 0)
    total = IntegerSum((Term(("a", "n"), 1), Term(("c",), 1, 12)), 20)
    # A sum is computed down to 8 bits below its last place, and a n ends 12 bits below those.
    assert names_and_bits(a, c, nothing, value("y", total, 8, 1 << 8)) == {"a": 12}
