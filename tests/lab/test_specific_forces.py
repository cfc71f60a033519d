"""Specific forces: exact increments, and the velocity and position that they lead to."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad

from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.specific_forces import force

CONE = motion("coning", a_deg_s=40, b_deg_s=70, g_deg_s=20)
TENTH = Fraction(1, 10)


def test_increments_are_the_integrals_of_the_force():
    waves = force("oscillation", swing_x_m_s2=3, swing_z_m_s2=2, frequency_hz=4, phase_deg=30, y_g="0.5")

    def along_x(t):
        return 3 * np.cos(8 * np.pi * t + np.pi / 6)

    increments = waves.velocity_increments(CONE, TENTH, -1, 2)
    expected = [quad(along_x, k / 10, (k + 1) / 10)[0] for k in (-1, 0, 1)]
    np.testing.assert_allclose(increments[:, 0], expected, atol=1e-14)
    np.testing.assert_allclose(increments[:, 1], 0.0980665 * 5, rtol=1e-14)


def test_a_random_force_has_its_size_and_no_power_above_its_band():
    noise = force("random", rms_m_s2=2)
    rows = noise.velocity_increments(CONE, Fraction(1, 500), 0, 50_000)
    np.testing.assert_allclose(np.sqrt((rows**2).mean(axis=0)) * 500, 2, rtol=0.02)
    spectrum = np.abs(np.fft.rfft(rows * np.hanning(len(rows))[:, None], axis=0))
    above = np.fft.rfftfreq(len(rows), 1 / 500) > 17
    assert spectrum[above].max() < 1e-3 * spectrum.max()


def test_a_lever_moves_on_a_sphere_whose_velocity_and_position_the_increments_lead_to(rng):
    """A body that turns about a point at rest: both sides of the truth, increments and closed form, must agree."""
    arm = force("lever", x_m=1, y_m=2, z_m=-1)
    velocity, position = arm.translation(CONE, TENTH, 20)
    np.testing.assert_allclose(position[0], 0, atol=1e-15)
    turned = CONE.attitude(np.arange(21) / 10)
    start = turned[0] @ np.cross(CONE.rate(0.0), [1, 2, -1])
    moved = position + np.outer(np.arange(21) / 10, start)
    np.testing.assert_allclose(np.linalg.norm(moved + np.array([1, 2, -1]), axis=1), np.sqrt(6), rtol=1e-13)
    # Of short intervals the force is nearly constant: the sum of turned increments tends to the velocity.
    fine = [Fraction(1, 1000), Fraction(1, 2000)]
    errors = []
    for interval in fine:
        count = int(2 / interval)
        rows = arm.velocity_increments(CONE, interval, 0, count)
        middles = CONE.attitude((np.arange(count) + 0.5) * float(interval))
        errors.append(np.abs(np.einsum("kij,kj->i", middles, rows) - velocity[-1]).max())
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)


def test_the_quadrature_of_the_truth_meets_a_closed_form():
    """A constant force on a body that turns about z: velocity and position are sines and cosines."""
    turn, push = motion("constant", z_rad_s=2), force("constant", x_m_s2=3)
    velocity, position = push.translation(turn, Fraction(1, 8), 40)
    t = np.arange(41) / 8
    np.testing.assert_allclose(
        velocity[:, :2], 1.5 * np.stack([np.sin(2 * t), 1 - np.cos(2 * t)], 1), atol=1e-13
    )
    np.testing.assert_allclose(
        position[:, :2], 0.75 * np.stack([1 - np.cos(2 * t), 2 * t - np.sin(2 * t)], 1), atol=1e-12
    )
