"""The study of velocity and position: candidates, cost, back ends, and its command."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.specific_forces import force
from strapgen.navigation.translations import DEFAULT, TestProfile, candidates, study


def flight(backend="numpy", duration="2", hertz=10):
    cone = motion("cone", half_angle_deg=1, frequency_hz=hertz)
    swing = force("oscillation", swing_y_g=1, frequency_hz=hertz)
    return TestProfile(cone, swing, Fraction(100), Fraction(duration), backend)


def test_every_method_has_a_velocity_and_windows_beat_the_recursion():
    names = ["two-speed:2", "rk4:2", "window-3-3"]
    rows = {one.name: one for one in study(candidates(names), flight(hertz=2))}
    recursion, step, window = rows.values()
    # Errors begin at the second, fourth and sixth power of the angle by which the motion goes on between samples.
    angle = 2 * math.pi * 2 / 100
    assert recursion.velocity_m_s > step.velocity_m_s > window.velocity_m_s / angle**2
    assert recursion.position_m > window.position_m / angle**4
    assert recursion.multiply < step.multiply < window.multiply


def test_the_default_algorithms_exist():
    assert len(candidates(DEFAULT)) == len(DEFAULT)


def test_fixed_point_adds_rounding_alone():
    double, fixed = (
        next(study(candidates(["rk4:2"]), flight(backend))) for backend in ("numpy", "c-fixed32")
    )
    assert fixed.velocity_m_s == pytest.approx(double.velocity_m_s, abs=1e-5)


def test_a_duration_that_is_no_multiple_of_a_sample_is_refused():
    with pytest.raises(InputError, match="is not a whole multiple of the sampling interval"):
        list(study(candidates(["rk4:2"]), flight(duration="0.015")))
