"""Rates without a closed-form attitude: their integrals, their size and band, what a gyro passes on of them."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions import rate_profiles

MOTIONS = {
    "random": ("random", {"rate_deg_s": 200}),
    "soft slew": ("slew", {"onset_s": 0.05}),
    "sharp slew": ("slew", {"onset_s": 0.0001}),
    "ramps": ("ramps", {"onset_s": 0.05}),
    "vibration": ("vibration", {"angle_deg": 0.1}),
}


def motion(name: str) -> strapgen.Motion:
    kind, settings = MOTIONS[name]
    return strapgen.motion(kind, **settings)


@pytest.mark.long
@pytest.mark.parametrize("first", [-3, 299, 420])
@pytest.mark.parametrize("name", MOTIONS)
def test_increments_integrate_the_rate(name, first):
    """Before time 0, in the first onset and at the end of the first slew; neighbours leave no gap."""
    profile, interval = motion(name), Fraction(1, 100)
    onset = (3.0037, 4.2037, 3.003125, 3.053125, 4.203125, 4.253125)
    for k, increment in enumerate(profile.samples(interval, first, first + 3), first):
        span = k / 100, (k + 1) / 100
        kinks = [time for time in onset if span[0] < time < span[1]] or None
        for axis in range(3):
            integral, _ = quad(
                lambda t, axis=axis: profile.rate(t)[axis], *span, epsabs=1e-15, points=kinks, limit=200
            )
            # Each end of the interval is known to half a unit of its last place, times 5 rad/s.
            assert increment[axis] == pytest.approx(integral, abs=2e-14)


def test_increments_are_the_same_whatever_run_they_are_part_of():
    profile = motion("soft slew")
    whole = profile.samples(Fraction(1, 100), -5, 400)
    np.testing.assert_array_equal(whole[305:310], profile.samples(Fraction(1, 100), 300, 305))


def test_the_random_rate_has_its_size_and_its_band():
    """A cosine of amplitude 1 has the mean square 1/2; no two of an axis have the same frequency."""
    rate = rate_profiles.random_rate(2.0)
    np.testing.assert_allclose((rate.amplitudes**2 / 2).sum(axis=1), 4.0, rtol=1e-14)
    hertz = rate.frequencies / (2 * math.pi)
    assert hertz.shape == (3, 30)
    assert hertz.min() >= 0.2 and hertz.max() < 50 / 3
    assert all(len({*row}) == 30 for row in hertz.round(9))
    # The first of each axis by hand: frac(sqrt 2), frac(sqrt 7).
    assert hertz[0, 0] == pytest.approx(0.2 + (50 / 3 - 0.2) * 0.41421356237309515)
    assert rate.phases[0, 0] == pytest.approx(2 * math.pi * 0.6457513110645906)


def test_a_slew_has_its_rate_between_its_onsets_and_none_after():
    sway = rate_profiles.slew(0.05, 0.0)
    for name, onset in (("soft slew", 0.05), ("ramps", 0.05), ("sharp slew", 0.0001)):
        profile = motion(name)
        for k in (0, 7):
            middle = 3.0037 + 7 * k + 0.6
            axis = np.sin([1.7 * k + 0.3, 2.3 * k + 1.1, 2.9 * k + 2.0])
            rate = profile.rate(middle) - sway.rate(middle)
            # tanh(0.6/0.05) is 1 but for 4e-11.
            np.testing.assert_allclose(
                rate, math.radians(300) * axis / np.linalg.norm(axis), rtol=1e-9, err_msg=f"{name} {onset}"
            )
            after = middle + 3.5
            np.testing.assert_allclose(profile.rate(after), sway.rate(after), atol=1e-12)


def test_a_ramp_is_linear_and_keeps_to_its_times():
    profile, sway = motion("ramps"), rate_profiles.slew(0.05, 0.0)
    start = 0.01 * (300 + 700 + 5 / 16)
    times = start + np.array([-0.001, 0.0, 0.0125, 0.025, 0.05, 0.06, 1.2, 1.225, 1.25, 1.3])
    size = np.linalg.norm(profile.rate(times) - sway.rate(times), axis=1) / math.radians(300)
    np.testing.assert_allclose(size, [0, 0, 0.25, 0.5, 1, 1, 1, 0.5, 0, 0], atol=1e-12)


def test_the_sway_is_that_of_three_sines():
    time = np.array([0.0, 1.0, 50.0])
    expected = np.stack(
        [20 * np.sin(1.3 * time), 30 * np.sin(0.9 * time + 0.5), 25 * np.sin(0.7 * time + 1)], 1
    )
    np.testing.assert_allclose(np.degrees(rate_profiles.ramps(0.05, 0.0).rate(time)), expected, atol=1e-13)


def test_a_vibration_has_its_angle_and_y_comes_a_quarter_period_after_x():
    profile = rate_profiles.vibration_rate(0.003, math.inf)
    angles = profile.amplitudes / profile.frequencies
    np.testing.assert_allclose(np.sqrt((angles**2 / 2).sum(axis=1)), 0.003, rtol=1e-14)
    np.testing.assert_allclose(angles, angles[0, 0])
    np.testing.assert_allclose(profile.frequencies[0] / (2 * math.pi), np.linspace(2, 30, 40))
    np.testing.assert_allclose(profile.phases[0] - profile.phases[1], math.pi / 2)
    assert abs(np.exp(1j * (profile.phases[0] - profile.phases[2])).sum()) < 20  # forty would be in step


def test_a_gyro_passes_on_what_a_butterworth_filter_does():
    profile = rate_profiles.vibration_rate(0.003, math.inf)
    cutoff, s = 2 * math.pi * 40, 1j * profile.frequencies[0]
    # The poles of the filter lie on a circle.
    first, second = cutoff * np.exp(1j * np.pi * np.array([3, 5]) / 4)
    response = cutoff**2 / ((s - first) * (s - second))
    filtered = profile.filtered(cutoff)
    before = profile.amplitudes * np.exp(1j * profile.phases)
    np.testing.assert_allclose(
        filtered.amplitudes * np.exp(1j * filtered.phases), before * response, rtol=1e-12
    )


def test_the_truth_is_not_what_the_gyro_passes_on():
    ideal, seen = (strapgen.motion("vibration", angle_deg=0.1, **gyro) for gyro in ({}, {"gyro_hz": 40}))
    np.testing.assert_array_equal(ideal.rate(0.3), seen.rate(0.3))
    np.testing.assert_array_equal(ideal.attitude(0.3), seen.attitude(0.3))
    lag = np.abs(ideal.samples(Fraction(1, 100), 0, 9) - seen.samples(Fraction(1, 100), 0, 9)).max()
    assert lag > 1e-4
    wide = strapgen.motion("vibration", angle_deg=0.1, gyro_hz=1e9)
    np.testing.assert_allclose(
        wide.samples(Fraction(1, 100), 0, 9), ideal.samples(Fraction(1, 100), 0, 9), atol=1e-9
    )


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("random", {}, "motion random needs parameters; allowed: rate_deg_s, rate_rad_s"),
        ("slew", {"rate_deg_s": 1}, "motion slew lacks onset_s"),
        ("slew", {"onset_s": 0}, "onset_s is 0; 0.0001 to 1.2 is needed"),
        ("slew", {"onset_s": "1e308"}, "onset_s is 1e[+]308; 0.0001 to 1.2 is needed"),
        ("ramps", {"onset_s": "1e308"}, "onset_s is 1e[+]308; 0.0001 to 1.2 is needed"),
        ("ramps", {"onset_s": 0.0501}, "onset_s is 0.0501; a multiple of 0.01/16 s is needed"),
        ("vibration", {"gyro_hz": 40}, "motion vibration lacks angle_deg or angle_rad"),
        ("vibration", {"angle_deg": 1, "gyro_hz": -1}, "gyro_hz is -1; at least 0.001 is needed"),
    ],
)
def test_settings_that_cannot_be_used(name, settings, words):
    with pytest.raises(InputError, match=words):
        strapgen.motion(name, **settings)
