"""The scale of a gyro that counts: read from its units, and written."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import mpmath
import pytest

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.units import Sensor

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
def test_what_makes_no_scale_is_refused(stated, said):
    with pytest.raises(InputError, match=said):
        Settings.of(**stated)
