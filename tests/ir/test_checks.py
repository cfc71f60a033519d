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
    with pytest.raises(
        InputError, match=r"^form 'rk5' is not known \(did you mean rk1 or rk4\?\); allowed: rk1, rk4$"
    ):
        checks.choice("form", "rk5", ["rk1", "rk4"])


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


@pytest.mark.parametrize(
    "value",
    [
        *(
            "",
            "x",
            "nan",
            "-inf",
            "Infinity",
            "1e999",
            "1e999999999",
            "1/0",
            "1 2",
            "0x10",
            "1,5",
            "--1",
            "1_0",
            "1_0/8",
            "1/1_0",
            "٣",
            "٣/٤",
        ),
        *(math.nan, -math.inf, np.nan, None, True, [1.0], 1j, "1/00000"),
    ],
)
def test_no_number(value):
    with pytest.raises(InputError, match=r"^step is .*; a finite number is needed$"):
        checks.number("step", value)


def test_double_reads_what_number_reads():
    assert [checks.double(text) for text in ("1", " -2.5e3 ", "\t.5", "1e999")] == [1, -2500, 0.5, math.inf]
    unread = ("", "x", "1_0", "1e1_0", "٣", "1/8", "0x10", "nan")
    assert [text for text in unread if not math.isnan(checks.double(text))] == []


def test_whole_reads_digits_alone():
    assert [checks.whole("word", text) for text in ("16", " 16 ", "-3", "+007")] == [16, 16, -3, 7]
    for text in ("", "x", "1_0", "٣", "1.0", "1e3", "0x10", "1 2"):
        with pytest.raises(InputError, match=rf"^word is {re.escape(repr(text))}; a whole number is needed$"):
            checks.whole("word", text)


@pytest.mark.parametrize("value", ["0", -0.0, "-1e-9", Fraction(-1, 3), "1e-400"])
def test_number_above_zero(value):
    with pytest.raises(InputError, match=r"^step is .*; a number above 0 is needed$"):
        checks.number("step", value, positive=True)


@pytest.mark.parametrize("value", [1, 8, np.int32(3), np.uint8(2)])
def test_count(value):
    counted = checks.count("increments", value, largest=8)
    assert counted == value
    assert type(counted) is int


@pytest.mark.parametrize("value", [0, -1, 9, 1.0, "2", None, True, np.float64(2), np.True_])
def test_no_count(value):
    with pytest.raises(InputError, match=r"^increments is .*; a whole number from 1 to 8 is needed$"):
        checks.count("increments", value, largest=8)


def test_count_without_limit():
    assert checks.count("record_every", 10**6) == 10**6
    with pytest.raises(InputError, match=r"^record_every is 0; a whole number at least 1 is needed$"):
        checks.count("record_every", 0)


def test_multiple():
    assert checks.multiple("duration", Fraction(180), "step", Fraction("0.125")) == 1440
    assert checks.multiple("duration", Fraction("0.3"), "step", Fraction("0.1")) == 3


@pytest.mark.parametrize(("value", "unit"), [("180", "0.7"), ("0.05", "0.1"), ("1", "3")])
def test_no_multiple(value, unit):
    with pytest.raises(InputError, match=f"^duration {value} s is not a whole multiple of the step {unit} s"):
        checks.multiple("duration", Fraction(value), "step", Fraction(unit))


@pytest.mark.parametrize("value", ["1e308", "1e9"])
def test_multiple_that_no_machine_holds(value):
    with pytest.raises(InputError, match=r"^duration .* that is too many$"):
        checks.multiple("duration", Fraction(value), "step", Fraction("1e-300"))


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


@pytest.mark.parametrize("value", [[True] * 3, ["a"] * 3, [1j] * 3, [None] * 3, None, "abc"])
def test_array_of_another_type(value):
    with pytest.raises(InputTypeError, match=r"^rate has dtype .*; numbers are needed"):
        checks.real_array("rate", value, (3,))


@pytest.mark.parametrize("shape", [(), (2,), (4,), (3, 1), (3, 0)])
def test_array_of_another_shape(shape):
    with pytest.raises(InputError, match=r"^rate has shape \(.*\); \(\.\.\., 3\) is needed$"):
        checks.real_array("rate", np.zeros(shape), (3,))


@pytest.mark.parametrize("shape", [(9,), (3,), (3, 4), (4, 3, 2), ()])
def test_matrix_of_another_shape(shape):
    with pytest.raises(InputError, match=r"\(\.\.\., 3, 3\) is needed$"):
        checks.real_array("state", np.zeros(shape), (3, 3))


def test_ragged_array():
    with pytest.raises(InputError, match=r"^rate has rows of different lengths"):
        checks.real_array("rate", [[1.0, 2.0, 3.0], [1.0]], (3,))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_array_that_is_not_finite_names_the_place(bad):
    values = np.zeros((5, 2, 3))
    values[3, 1, 2] = bad
    with pytest.raises(
        InputError, match=rf"^rate holds {bad} at index \(3, 1, 2\); finite numbers are needed$"
    ):
        checks.real_array("rate", values, (3,))


def test_infinities_that_cancel_are_seen():
    with pytest.raises(InputError, match=r"holds inf at index \(0,\)"):
        checks.real_array("rate", [np.inf, -np.inf, 0.0], (3,))


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
