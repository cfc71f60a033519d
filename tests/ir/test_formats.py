"""Formats and settings: read, written, refused."""

from __future__ import annotations

import json
import math
import re
from fractions import Fraction
from itertools import pairwise

import mpmath
import pytest
from derived import program, quantized
from hypothesis import given
from hypothesis import strategies as st

import strapgen
from strapgen import catalogue, fixedpoint, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import formats
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format, finest, from_digits, signed_digits
from strapgen.ir.units import Sensor
from strapgen.targets import contract


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
def test_fitted_settings_hold_the_largest_increment(largest):
    fitted = float(Settings().fitted(largest).largest_angle)
    assert largest <= fitted <= largest * 9 / 8


@given(st.integers(-(1 << 63), 1 << 63))
def test_digits_stand_for_their_number_and_no_two_are_neighbours(value):
    digits = signed_digits(value)
    assert from_digits(digits) == value
    powers = [power for _, power in digits]
    assert all(above - below > 1 for above, below in pairwise(powers))
    # A number of n bits has no more than half of n + 1 digits.
    assert len(digits) <= (abs(value).bit_length() + 2) // 2


@given(st.integers(-(1 << 31), 1 << 31), st.integers(1, 8))
def test_truncation_is_at_most_two_thirds_of_the_next_digit(value, most):
    digits = signed_digits(value)
    cut = signed_digits(value, most)
    assert cut == digits[:most]
    left = abs(value - from_digits(cut))
    assert left == 0 or 3 * left < 2 * 2 ** (digits[most][1] + 1)


ERROR = re.compile(r"error <= (\S+) \((\S+) ulp\)")
RANGE = re.compile(r"range (-?\d+) to (-?\d+) \((\S+) to (\S+)\)")


def test_headers_of_the_catalogue_state_no_less_than_is_certified():
    stated = 0
    for choice in catalogue.standard():
        if not fixedpoint.can_lower(program(choice)):
            continue
        fixed = quantized(choice, Settings())
        for argument in (*fixed.interface.inputs, *fixed.interface.outputs):
            text = contract.argument_text(argument)
            low, high = map(Fraction, RANGE.search(text).groups()[2:])
            assert low <= argument.low * argument.unit
            assert argument.high * argument.unit <= high
            if (shown := ERROR.search(text)) is not None:
                worst, places = map(Fraction, shown.groups())
                exact = max(argument.errors)
                assert exact <= worst < exact * (1 + Fraction(1, 10**5))
                assert exact / argument.unit <= places < exact / argument.unit + Fraction(1, 10**4)
                stated += 1
        for name, error in fixed.as_data()["error_bound"].items():
            assert Fraction(error) >= fixed.error_bounds[name]
        for name, ends in fixed.as_data()["ranges"].items():
            assert Fraction(ends[0]) <= fixed.ranges[name][0]
            assert Fraction(ends[1]) >= fixed.ranges[name][1]
    assert stated > 30


def test_bound_that_a_call_attains_is_not_rounded_down():
    """A call of this kernel is off by 2^-24."""
    ranges = dict.fromkeys(("navigation_rotation", "previous_turn", "turn"), Fraction(1, 300))
    fixed = pipeline.fixed_program(Choice("navigation-rotation"), Settings(word=16, ranges=ranges))
    shown = [ERROR.search(contract.argument_text(output)) for output in fixed.interface.outputs]
    assert max(Fraction(text[1]) for text in shown if text) >= Fraction(1, 2**24)


@pytest.mark.parametrize(
    "value", [Fraction(1, 3), Fraction(-1, 3), Fraction(10**20, 7), Fraction(1, 3 * 10**9)]
)
def test_rounding_goes_one_way(value):
    for digits in (2, 4, 6):
        for style in "ge":
            low = Fraction(formats.below(value, digits, style))
            high = Fraction(formats.above(value, digits, style))
            assert low < value < high < value + abs(value) / 10 ** (digits - 2)
    assert Fraction(formats.float_below(value)) < value < Fraction(formats.float_above(value))
    assert value < Fraction(formats.places_above(value, 3)) <= value + Fraction(1, 1000)


HUNDREDTH = Fraction(1, 100)


@pytest.mark.parametrize(
    ("lsb", "degrees"),
    [
        ("0.0175dps", "0.000175"),
        ("17.5mdps", "0.000175"),
        ("1/131 dps", Fraction(1, 13100)),
        (" 2dps", "0.02"),
    ],
)
def test_a_rate_a_count_is_an_angle_to_40_digits(lsb, degrees):
    with mpmath.workdps(60):
        degrees = Fraction(degrees)
        exact = mpmath.pi / 180 * degrees.numerator / degrees.denominator
        count = Sensor.of(lsb, HUNDREDTH).count
        assert abs(mpmath.mpf(count.numerator) / count.denominator / exact - 1) < mpmath.mpf(10) ** -45


def test_an_angle_a_count_is_exact():
    assert Sensor.of("3e-6rad").count == Fraction(3, 10**6)
    assert Sensor.of("1/327680rad").count == Fraction(1, 327680)
    assert Sensor.of("1/4rad/s", HUNDREDTH).count == Fraction(1, 400)


@pytest.mark.parametrize(
    "count",
    [Fraction(3, 10**6), Fraction(1, 1 << 20), Fraction(1, (1 << 20) - 1), Fraction(1, (1 << 20) + 1)],
)
def test_a_scale_lies_above_a_half_and_at_most_at_1(count):
    sensor = Sensor(count, "", "")
    assert Fraction(1, 2) < sensor.scale <= 1
    assert sensor.scale / Fraction(2) ** sensor.fraction == count


def test_the_bits_of_a_usual_gyro_bound_its_increments():
    settings = Settings.of(sample_hz=100, lsb="0.0175dps")
    assert settings.input_bits == 16
    assert float(settings.largest_angle) == pytest.approx(math.radians(0.0175 * 32768) / 100)
    # A stated rate bounds them too, whichever is smaller.
    assert (
        Settings.of(sample_hz=100, lsb="0.0175dps", max_rate_deg_s=400).largest_angle < settings.largest_angle
    )
    assert (
        Settings.of(sample_hz=100, lsb="0.0175dps", max_rate_deg_s=900).largest_angle
        == settings.largest_angle
    )
    assert Settings.of(word=32, lsb="3e-9rad", input_bits=24).input_bits == 24
    assert Settings.of(word=8, lsb="3e-4rad").input_bits == 8


def test_the_time_of_a_count_follows_from_the_step_too():
    by_step = Settings.of(step="0.02", increments=2, lsb="0.0175dps").sensor
    assert by_step.count == Settings.of(sample_hz=100, increments=2, lsb="0.0175dps").sensor.count


@pytest.mark.parametrize(
    "stated",
    [
        {"lsb": "17.5mdps", "sample_hz": 100, "state": "q31"},
        {"lsb": "1/30000000rad", "input_bits": 24},
        {"word": 16, "state": "q15"},
    ],
)
def test_settings_are_read_as_they_are_written(stated):
    settings = Settings.of(**stated)
    again = Settings.from_dict(json.loads(json.dumps(settings.as_dict())))
    assert again == settings and again.stated == settings.stated


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"lsb": "0.0175dps"}, "--sample-hz is missing"),
        ({"lsb": 0.0175, "sample_hz": 100}, "a number with its unit is needed"),
        ({"sample_hz": 100}, "max_rate_deg_s or an lsb that is a rate is missing"),
        ({"lsb": "3e-6rad", "sample_hz": 100}, "max_rate_deg_s or an lsb that is a rate is missing"),
        ({"sample_hz": 100, "step": 1, "max_rate_deg_s": 1}, "both given; one is needed"),
        ({"lsb": "1rad"}, "from 1e-11 to 4 is needed"),
    ],
)
def test_invalid_scales_are_refused(stated, said):
    with pytest.raises(InputError, match=said):
        Settings.of(**stated)


STATED = {"max_rate_deg_s": 400, "step": "0.01"}


@pytest.mark.parametrize(
    "chosen",
    [
        ("euler", "rk4", 1),
        ("euler", "rk4", 2),
        ("dcm", "rk3", 3, False, 2),
        ("velocity-position", "coning-combined", 2, False, 1),
        ("rotation-vector", "coning-combined", 3),
    ],
)
def test_the_program_gives_the_increments_that_are_not_stated(chosen):
    choice = strapgen.choose(*chosen)
    program = strapgen.lower(strapgen.derive(choice))
    assert program.increments_per_step == choice.increments == chosen[2]
    open_number, stated = Settings.of(**STATED), Settings.of(increments=chosen[2], **STATED)
    assert open_number.for_program(program.increments_per_step, choice.kernel) == stated
    assert (open_number == stated) is False
    assert Settings.from_dict(open_number.as_dict()) == open_number


def test_every_way_into_fixed_point_resolves_the_increments():
    choice, program = strapgen.choose("euler"), strapgen.lower(strapgen.derive("euler"))
    stated, open_number = Settings.of(increments=2, **STATED), Settings.of(**STATED)
    wanted = strapgen.quantize(program, stated)
    assert strapgen.quantize(program, open_number) == wanted
    assert pipeline.fixed_program(choice, open_number) == wanted
    assert (
        pipeline.compile(choice, "c-fixed", open_number).files == strapgen.generate(wanted, "c-fixed").files
    )
    for name in ("c-fixed16", "fixed-model"):
        one, other = (
            strapgen.backend(choice, backend=name, settings=settings) for settings in (open_number, stated)
        )
        assert one.interface == other.interface
        assert one.interface.settings.largest_angle == stated.largest_angle
    bounds = [
        strapgen.rounding_bounds(program, settings=settings) for settings in (open_number, stated, Settings())
    ]
    assert bounds[0] == bounds[1] != bounds[2]


def test_a_gyro_that_counts_has_its_scale_from_the_program():
    program = strapgen.lower(strapgen.derive("euler"))
    gyro = {"step": "0.02", "lsb": "0.0175dps"}
    open_number, stated = Settings.of(**gyro), Settings.of(increments=2, **gyro)
    assert open_number.sensor != stated.sensor
    assert strapgen.quantize(program, open_number) == strapgen.quantize(program, stated)


def test_other_increments_than_the_program_s_are_refused():
    settings = Settings.of(increments=3, **STATED)
    said = r"^increments is 3, but euler-rk4-2 takes 2 increments a step$"
    for take in (
        lambda: strapgen.quantize(strapgen.lower(strapgen.derive("euler")), settings),
        lambda: strapgen.backend("euler", backend="c-fixed32", settings=settings),
        lambda: strapgen.generate(strapgen.lower(strapgen.derive("euler")), "c-fixed", settings),
    ):
        with pytest.raises(InputError, match=said):
            take()


def test_a_wide_step_is_divided_before_its_angle_is_refused():
    wide = Settings.of(max_rate_deg_s=400, step=1)
    assert wide.for_program(2, "two") == Settings.of(max_rate_deg_s=400, step=1, increments=2)
    with pytest.raises(InputError, match=r"largest angle increment is 6\.98132 rad"):
        wide.for_program(1, "one")
