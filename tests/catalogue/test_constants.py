"""Constants are read exactly, whatever they are written as, and written so that they are read again."""

from __future__ import annotations

import shlex
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.catalogue.choice import constant_options, number_text, read_constants
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError


@pytest.mark.parametrize(
    "value", [0.02, "0.02", "1/50", Fraction(1, 50), Decimal("0.02"), np.float64(0.02), "2e-2"]
)
def test_a_number_is_exact_in_every_spelling(value):
    assert read_constants({"cycle": value}) == (("cycle", (Fraction(1, 50),)),)


def test_rows_follow_each_other_and_names_are_sorted():
    rows = (("a", (Fraction(7),)), ("b", tuple(map(Fraction, range(4)))))
    assert read_constants({"b": [[0, 1], [2, 3]], "a": 7}) == rows
    assert read_constants({"a": [7], "b": np.arange(4.0).reshape(2, 2)}) == rows


@pytest.mark.parametrize(
    ("constants", "error", "words"),
    [
        ({"cycle": "fast"}, InputError, "constant cycle is 'fast'; a finite number is needed"),
        ({"cycle": float("nan")}, InputError, "constant cycle is 'nan'"),
        ({"cycle": True}, InputError, "constant cycle is 'True'"),
        ({"cycle": [1, [2, None]]}, InputError, "constant cycle is 'None'"),
        ({3: 1}, InputTypeError, "constants holds 3; the name of an input is needed"),
        ([("cycle", 1)], InputTypeError, "a mapping from names of inputs is needed"),
    ],
)
def test_what_is_no_number_is_refused(constants, error, words):
    with pytest.raises(error) as caught:
        read_constants(constants)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@given(st.fractions(max_denominator=10**9) | st.floats(-1e30, 1e30).map(lambda x: checks.number("x", x)))
def test_the_text_of_a_number_is_read_as_that_number(number):
    assert checks.number("x", number_text(number)) == number
    assert len(number_text(number)) <= max(8, len(str(number)))


def test_a_long_option_has_spaces_inside_quotes_for_lines_to_break():
    constants = read_constants({"cycle": 0.02, "rate_scale": [Fraction(10**16 // 3, 10**25)] * 9})
    short, long = shlex.split(constant_options(constants))[1::2]
    assert short == "cycle=0.02"
    assert long.startswith("rate_scale=3.333333333333333e-10, 3.3") and long.count(", ") == 8
