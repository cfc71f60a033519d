"""What the contract of generated code says of an argument and of a value."""

from __future__ import annotations

from fractions import Fraction

import pytest

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum, Value
from strapgen.targets.contract import argument_text, value_text


@pytest.mark.parametrize(
    ("settings", "limits", "error"),
    [
        # A product is rounded by half a place.
        (
            Settings(word=16),
            "format Q1.14, unit 2^-14; range -17408 to 17408 (-1.0625 to 1.0625)",
            "error <= 3.05176e-05 (0.5000 ulp)",
        ),
        # What saturates stores 1 itself as a place less.
        (
            Settings(word=16, state="q15"),
            "format Q0.15, unit 2^-15; range -32768 to 32767 (-1 to 0.99997)",
            "saturates at both ends; error <= 3.05176e-05 (1.0000 ulp), where the exact value is "
            "from -1 to 1; beyond, at most the larger of this and its distance from the range",
        ),
    ],
)
def test_an_output_tells_its_error_and_whether_it_saturates_and_an_input_neither(settings, limits, error):
    interface = pipeline.compile(choose("euler-product"), "c-fixed", settings).fixed
    assert [argument_text(argument) for argument in interface.inputs] == [limits, limits]
    assert [argument_text(argument) for argument in interface.outputs] == [f"{limits}; {error}"]


def test_a_value_tells_its_format_and_its_range_outward_and_its_error_upward():
    """Of integers from -7 to 1001 in Q5.10 the range is -0.0068359... to 0.97753..., rounded away from each other."""
    value = Value("x", IntegerSum(()), 10, False, -7, 1001, Fraction(0), Fraction(1, 999), 1001)
    assert value_text(value, 16) == "Q5.10, -0.00684 .. 0.978, error 0.0011"
