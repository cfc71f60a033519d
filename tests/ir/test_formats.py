"""Formats and settings: read, written, refused."""

from __future__ import annotations

import json
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format, finest


@given(st.integers(8, 64), st.integers(-20, 200))
def test_a_format_is_read_as_it_is_written(word, fraction):
    made = Format(word, fraction)
    assert Format.parse(str(made), word) == made
    assert made.unit == Fraction(1, 2**fraction) if fraction >= 0 else 2**-fraction


@given(st.fractions(min_value=Fraction(1, 10**9), max_value=10**6), st.integers(8, 64))
def test_the_finest_format_holds_its_magnitude_and_none_finer_does(largest, word):
    fraction = finest(largest, word)
    top = Format(word, fraction).largest
    assert largest * Fraction(2) ** fraction <= top
    assert largest * Fraction(2) ** (fraction + 1) > top


@pytest.mark.parametrize(
    ("text", "said"),
    [("Q1.31", "33 bits"), ("q1.30", "Qm.n is needed"), ("1.30", "Qm.n"), ("", "Qm.n"), ("Q١.30", "Qm.n")],
)
def test_formats_that_cannot_be_used(text, said):
    with pytest.raises(InputError, match=said):
        Format.parse(text, 32)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"word": 7}, "word is 7; a whole number of bits from 8 to 64"),
        ({"word": 65}, "word is 65"),
        ({"word": True}, "word is True"),
        ({"rounding": "up"}, "rounding 'up' is not known; allowed: nearest, truncation"),
        ({"carry": "p"}, "carry 'p' is not known; allowed: none, state, full"),
        ({"largest_angle": "5"}, "largest angle increment is 5 rad"),
        ({"largest_angle": "0"}, "largest angle is 0"),
        ({"max_rate_deg_s": 10}, "step is missing"),
        ({"step": 1}, "max_rate_deg_s is missing"),
        ({"max_rate_deg_s": 10, "step": 1, "largest_angle": 1}, "both given"),
        ({"allowance": Fraction(2)}, "drift allowance is 2"),
        ({"ranges": {"time": Fraction(0)}}, "range of time is 0"),
        ({"formats": {"state": "Q3.3"}}, "format Q3.3 has 7 bits"),
    ],
)
def test_settings_that_cannot_be_used(values, said):
    with pytest.raises(InputError, match=said):
        Settings.of(**values)


def test_the_largest_angle_is_not_below_rate_times_step():
    settings = Settings.of(max_rate_deg_s="12", step="0.125", increments=2)
    # 0.75 deg, in pi of 40 digits.
    exact = Fraction(3141592653589793238462643383279502884197, 10**39) * Fraction(75, 100) / 180
    assert exact <= settings.largest_angle < exact + Fraction(1, 2**59)


def test_settings_survive_json():
    settings = Settings.of(
        word=16,
        largest_angle="1/3",
        carry="full",
        ranges={"time": Fraction(2, 3)},
        formats={"state": "Q1.14"},
    )
    assert Settings.from_dict(json.loads(json.dumps(settings.as_dict()))) == settings


@given(st.floats(1e-9, 3.5))
def test_fitted_settings_hold_what_they_are_fitted_to(largest):
    fitted = float(Settings().fitted(largest).largest_angle)
    assert largest <= fitted <= largest * 9 / 8
