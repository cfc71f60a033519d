"""Motions as numbers: parameters, increments that add up, truth that stays a rotation."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad
from tolerances import roundoff

import strapgen
from strapgen.ir.exceptions import InputError

MOTIONS = {
    "constant": {"x_deg_s": 3, "y_deg_s": -5, "z_deg_s": 7},
    "sinusoidal": {"a_deg_s": 10, "b_deg_s": 20},
    "coning": {"a_deg_s": 10, "b_rad_s": -0.3, "g_deg_s": 4},
    "polynomial": {"a0": 1, "a1": 0.2, "a2": -0.03, "a3": 0.004, "a4": -0.0005},
}


@pytest.mark.long
@pytest.mark.parametrize("name", MOTIONS)
def test_increments_integrate_the_rate(name):
    motion = strapgen.motion(name, **MOTIONS[name])
    h = Fraction(1, 4)
    increments = motion.increments(h, 3, 3).reshape(-1, 3)
    for k, increment in enumerate(increments):
        span = (k * float(h) / 3, (k + 1) * float(h) / 3)
        for axis in range(3):
            integral, error = quad(lambda t, axis=axis: motion.rate(t)[axis], *span, epsabs=1e-15)
            assert increment[axis] == pytest.approx(integral, abs=error + 1e-15)


@pytest.mark.long
@pytest.mark.parametrize(("count", "previous"), [(1, 1), (1, 3), (2, 2), (3, 1)])
@pytest.mark.parametrize("name", MOTIONS)
def test_increments_before_the_start_are_those_of_the_motion_before_it(name, count, previous):
    motion = strapgen.motion(name, **MOTIONS[name])
    h = Fraction(1, 4)
    increments = motion.increments(h, 4, count, previous)
    assert increments.shape == (4, previous + count, 3)
    # What belongs to the steps is what they take without history.
    np.testing.assert_array_equal(increments[:, previous:], motion.increments(h, 4, count))
    width = float(h) / count
    for k in range(previous):
        span = ((k - previous) * width, (k - previous + 1) * width)
        for axis in range(3):
            integral, error = quad(lambda t, axis=axis: motion.rate(t)[axis], *span, epsabs=1e-15)
            assert increments[0, k, axis] == pytest.approx(integral, abs=error + 1e-15)


def test_previous_increments_raise_the_order_of_a_slow_gyro():
    motion = strapgen.motion("coning", **MOTIONS["coning"])

    def error(previous: int, step: Fraction) -> float:
        backend = strapgen.backend("euler", "rk4", 1, "numpy", previous=previous)
        return float(np.abs(strapgen.simulate(backend, motion, step, 4).error).max())

    coarse, fine = Fraction(1, 10), Fraction(1, 20)
    orders = [np.log2(error(previous, coarse) / error(previous, fine)) for previous in (0, 1, 2)]
    assert orders == pytest.approx([2, 3, 4], abs=0.2)


@pytest.mark.long
@pytest.mark.parametrize("name", MOTIONS)
def test_a_fine_run_meets_the_truth(name, backend_name):
    motion = strapgen.motion(name, **MOTIONS[name])
    backend = strapgen.backend("euler", "rk4", 2, backend_name)
    run = strapgen.simulate(backend, motion, Fraction(1, 200), 4)
    # Truncation at this step is below 1e-12; 800 steps of round-off, doubled by the conversion.
    assert np.abs(run.error).max() <= 1e-12 + 2 * roundoff(backend, 800)


@pytest.mark.parametrize("name", MOTIONS)
def test_truth_is_a_rotation_that_starts_at_the_identity(name):
    attitude = strapgen.motion(name, **MOTIONS[name]).attitude(np.linspace(0, 180, 50))
    np.testing.assert_array_equal(attitude[0], np.eye(3))
    np.testing.assert_allclose(
        attitude @ np.swapaxes(attitude, 1, 2), np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-14
    )


def test_removable_singularities():
    still = strapgen.motion("constant", x_deg_s=0)
    np.testing.assert_array_equal(still.attitude([0.0, 5.0]), np.broadcast_to(np.eye(3), (2, 3, 3)))
    # b = 0: a constant rate about y, and about (0, g, a).
    slow = strapgen.motion("sinusoidal", a_deg_s=10, b_deg_s=0)
    steady = strapgen.motion("constant", y_deg_s=10)
    np.testing.assert_allclose(slow.attitude(7.0), steady.attitude(7.0), atol=1e-15)
    cone = strapgen.motion("coning", a_deg_s=10, b_deg_s=0, g_deg_s=3)
    steady = strapgen.motion("constant", y_deg_s=3, z_deg_s=10)
    np.testing.assert_allclose(cone.attitude(7.0), steady.attitude(7.0), atol=1e-15)
    np.testing.assert_allclose(
        cone.increments(Fraction(1), 2, 2), steady.increments(Fraction(1), 2, 2), atol=1e-16
    )
    # s = 0: a = 0, g = -b.
    cone = strapgen.motion("coning", a_deg_s=0, b_deg_s=5, g_deg_s=-5)
    np.testing.assert_allclose(
        cone.attitude(7.0), strapgen.motion("constant", y_deg_s=-5).attitude(7.0), atol=1e-15
    )


def test_the_axis_of_a_cone_keeps_its_angle_while_the_body_spins_about_it():
    cone = strapgen.motion("cone", half_angle_deg=20, frequency_hz=0.5, spin_deg_s=30)
    attitude = cone.attitude(np.linspace(0, 2, 33))
    tip = attitude[:, :, 1]
    centre = tip[:-1].mean(axis=0)
    np.testing.assert_allclose(tip @ centre / np.linalg.norm(centre), math.cos(math.radians(20)), atol=1e-14)
    # After a period of 2 s the axis is back, and the body has turned by 60 degrees about it.
    turned = strapgen.motion("constant", y_deg_s=30).attitude(2.0)
    np.testing.assert_allclose(attitude[-1], turned, atol=1e-14)
    np.testing.assert_allclose(cone.rate(0.7)[1], cone.rate(0)[1], rtol=1e-15)


def test_a_cone_without_spin_ends_where_it_began():
    cone = strapgen.motion("cone", half_angle_deg=15, frequency_hz=2)
    np.testing.assert_allclose(cone.attitude([0.5, 1.0]), [np.eye(3)] * 2, atol=1e-14)


def test_many_digits_need_a_closed_form():
    motion = strapgen.motion("random", rate_deg_s=10)
    with pytest.raises(
        InputError, match="the attitude of motion random has no closed form, which many digits need"
    ):
        strapgen.converge(strapgen.choose("euler"), motion, ["1/2", "1/4"], 1)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("spin", {}, "motion 'spin' is not known; allowed: constant, sinusoidal, coning, polynomial"),
        ("coning", {"a_deg_s": 1, "b_deg_s": 1}, "motion coning lacks g_deg_s or g_rad_s"),
        ("coning", {"c_deg_s": 1}, "key of motion coning: 'c_deg_s' is not known \\(did you mean a_deg_s"),
        ("sinusoidal", {"a_deg_s": 1, "b_deg_s": 1, "b_rad_s": 1}, "b_deg_s and b_rad_s are both given"),
        ("constant", {}, "motion constant needs parameters; allowed: x_deg_s"),
        ("constant", {"x_deg_s": "nan"}, "x_deg_s is 'nan'; a finite number is needed"),
        ("constant", {"x_deg_s": float("inf")}, "x_deg_s is 'inf'"),
        ("constant", {"x_deg_s": "ten"}, "x_deg_s is 'ten'"),
    ],
)
def test_settings_that_cannot_be_used(name, settings, words):
    with pytest.raises(InputError, match=words):
        strapgen.motion(name, **settings)
