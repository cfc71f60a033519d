"""Checks of names, numbers and arrays: each message names the thing, the value and what is allowed."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError, StrapgenError


def test_choice():
    assert checks.choice("method", "rk4", {"rk1": 1, "rk4": 2}) == "rk4"


def with_limits(name, value):
    return checks.count(name, value, largest=8)


def of_three(name, value):
    return checks.real_array(name, value, (3,))


def of_matrices(name, value):
    return checks.real_array(name, value, (3, 3))


def of_shape(shape):
    return np.zeros(shape)


REFUSED = [
    (
        lambda name, value: checks.choice(name, value, ["rk1", "rk4"]),
        r"x 'rk5' is not known \(did you mean rk1 or rk4\?\); allowed: rk1, rk4",
        ["rk5"],
    ),
    (
        checks.number,
        "x is .*; a finite number is needed",
        [
            *("", "x", "nan", "-inf", "Infinity", "1e999", "1e999999999", "1/0", "1 2", "0x10", "1,5", "--1"),
            *(
                "1_0",
                "1_0/8",
                "1/1_0",
                "٣",
                "٣/٤",
                "1/00000",
                math.nan,
                -math.inf,
                np.nan,
                None,
                True,
                [1.0],
                1j,
            ),
        ],
    ),
    (
        lambda name, value: checks.number(name, value, positive=True),
        "x is .*; a number above 0 is needed",
        ["0", -0.0, "-1e-9", Fraction(-1, 3), "1e-400"],
    ),
    (
        with_limits,
        "x is .*; a whole number from 1 to 8 is needed",
        [0, -1, 9, 1.0, "2", None, True, np.float64(2), np.True_],
    ),
    (checks.count, "x is 0; a whole number at least 1 is needed", [0]),
    (
        lambda name, value: checks.multiple(name, *map(Fraction, value[:1]), "step", Fraction(value[1])),
        "x .* s is not a whole multiple of the step .* s.*",
        [("180", "0.7"), ("0.05", "0.1"), ("1", "3")],
    ),
    (
        lambda name, value: checks.multiple(name, Fraction(value), "step", Fraction("1e-300")),
        "x .* that is too many",
        ["1e308", "1e9"],
    ),
    (
        of_three,
        "x has dtype .*; numbers are needed.*",
        [[True] * 3, ["a"] * 3, [1j] * 3, [None] * 3, None, "abc"],
    ),
    (
        of_three,
        r"x has shape \(.*\); \(\.\.\., 3\) is needed",
        [*map(of_shape, [(), (2,), (4,), (3, 1), (3, 0)])],
    ),
    (
        of_matrices,
        r".*\(\.\.\., 3, 3\) is needed",
        [*map(of_shape, [(9,), (3,), (3, 4), (4, 3, 2), ()])],
    ),
    (of_three, "x has rows of different lengths.*", [[[1.0, 2.0, 3.0], [1.0]]]),
    (of_three, r"x holds inf at index \(0,\).*", [[np.inf, -np.inf, 0.0]]),  # which cancel
]


@pytest.mark.parametrize(
    ("check", "said", "value"), [(check, said, value) for check, said, values in REFUSED for value in values]
)
def test_a_value_is_refused_in_one_line(check, said, value):
    kind = InputTypeError if "dtype" in said else InputError
    with pytest.raises(kind, match=f"^{said}$"):
        check("x", value)


@pytest.mark.parametrize(
    ("value", "exact"),
    [
        ("0.1", Fraction(1, 10)),
        (" 1e-3 ", Fraction(1, 1000)),
        ("1/8", Fraction(1, 8)),
        ("-2.50", Fraction(-5, 2)),
        (0.1, Fraction(1, 10)),
        (np.float64(0.1), Fraction(1, 10)),
        (np.float32(0.1), Fraction(1, 10)),
        (3, Fraction(3)),
        (np.int64(3), Fraction(3)),
        (Fraction(1, 3), Fraction(1, 3)),
        ("0", Fraction(0)),
        ("1e-400", Fraction(0)),
        ("-1e-999999999", Fraction(0)),
    ],
)
def test_number_is_exact(value, exact):
    assert checks.number("step", value) == exact


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_number_of_a_float_is_its_shortest_decimal(value):
    exact = checks.number("step", value)
    assert float(exact) == value
    assert exact == checks.number("step", repr(value)) == Fraction(repr(value))


def test_double_reads_what_number_reads():
    assert [checks.double(text) for text in ("1", " -2.5e3 ", "\t.5", "1e999")] == [1, -2500, 0.5, math.inf]
    unread = ("", "x", "1_0", "1e1_0", "٣", "1/8", "0x10", "nan")
    assert [text for text in unread if not math.isnan(checks.double(text))] == []


def test_whole_reads_digits_alone():
    assert [checks.whole("word", text) for text in ("16", " 16 ", "-3", "+007")] == [16, 16, -3, 7]
    for text in ("", "x", "1_0", "٣", "1.0", "1e3", "0x10", "1 2"):
        with pytest.raises(InputError, match=rf"^word is {re.escape(repr(text))}; a whole number is needed$"):
            checks.whole("word", text)


@pytest.mark.parametrize("value", [1, 8, np.int32(3), np.uint8(2)])
def test_count(value):
    counted = checks.count("increments", value, largest=8)
    assert counted == value
    assert type(counted) is int


def test_count_without_limit():
    assert checks.count("record_every", 10**6) == 10**6


def test_multiple():
    assert checks.multiple("duration", Fraction(180), "step", Fraction("0.125")) == 1440
    assert checks.multiple("duration", Fraction("0.3"), "step", Fraction("0.1")) == 3


def test_real_array_keeps_what_it_can():
    given_ = np.ones((4, 3))
    assert checks.real_array("increments", given_, (3,)) is given_
    assert checks.real_array("increments", [[0.5, 0.0, 1.0]], (3,)).dtype == np.float64
    assert checks.real_array("increments", np.ones((2, 3), np.float32), (3,)).dtype == np.float64
    assert checks.real_array("increments", np.ones((3, 2)).T, (3,)).flags.c_contiguous
    assert checks.real_array("time", 1.5, ()).shape == ()
    whole = checks.real_array("increments", [[1, 2, 3]], (3,))
    assert whole.dtype == np.float64 and whole.tolist() == [[1.0, 2.0, 3.0]]
    assert checks.real_array("increments", np.empty((0, 3)), (3,)).shape == (0, 3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_array_that_is_not_finite_names_the_place(bad):
    values = np.zeros((5, 2, 3))
    values[3, 1, 2] = bad
    with pytest.raises(
        InputError, match=rf"^rate holds {bad} at index \(3, 1, 2\); finite numbers are needed$"
    ):
        checks.real_array("rate", values, (3,))


@pytest.mark.filterwarnings("error")
def test_large_numbers_whose_sum_overflows_are_allowed():
    values = np.full(3, 1e308)
    np.testing.assert_array_equal(checks.real_array("rate", values, (3,)), values)


@pytest.mark.filterwarnings("error")
def test_range_of_single_precision():
    with pytest.raises(InputError, match=r"^rate holds numbers beyond the range of float32$"):
        checks.real_array("rate", [1e39, 0.0, 0.0], (3,), np.float32)
    assert checks.real_array("rate", [1e38, 0.0, 0.0], (3,), np.float32).dtype == np.float32


def test_errors_have_the_python_types_too():
    assert issubclass(InputError, StrapgenError) and issubclass(InputError, ValueError)
    assert issubclass(InputTypeError, StrapgenError) and issubclass(InputTypeError, TypeError)
