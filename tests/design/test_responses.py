"""What filters do, against sums in double precision over frequencies."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.special import spherical_jn

from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.filters import responses
from strapgen.design.filters.band_grid import ONE, REAL, BandGrid

GYRO = GyroResponse(Fraction(40), Fraction(7071, 10000), Fraction(100))


def answers(window, b):
    """Return what the samples of a window are for a unit of rate at frequencies, (n, samples)."""
    j = np.arange(window.samples) - window.previous
    gyro = np.ones_like(b, dtype=complex)
    if window.gyro is not None:
        x = 1j * b * float(window.gyro.sample_hz) / (2 * np.pi * float(window.gyro.bandwidth_hz))
        gyro = 1 / (1 + 2 * float(window.gyro.damping) * x + x**2)
    return (gyro * np.sinc(b / 2 / np.pi))[:, None] * np.exp(1j * b[:, None] * (j + 0.5))


def error(window, m, b, A):
    """Return the error of a filter from the definitions, (n,)."""
    N = window.increments
    C = N * (2 * m + 1) * 1j**m * spherical_jn(m, b * N / 2) * np.exp(0.5j * b * N)
    return np.abs(A @ np.array([float(tap) for tap in window.filters[m]]) - C)


#: Filters are evaluated whatever they are good for: those of one sample in steps of several.
WINDOWS_OF_SIX = [
    WINDOWS["window-3-3"],
    WINDOWS["window-5-1"],
    WINDOWS["window-0-6"],
    replace(WINDOWS["window-5-1"], previous=4, increments=2),
    replace(WINDOWS["window-3-3"], previous=2, ahead=2, increments=3),
]


@pytest.mark.parametrize("gyro", [None, GYRO], ids=["ideal", "gyro"])
@pytest.mark.parametrize("window", WINDOWS_OF_SIX, ids=lambda one: f"{one.name}-{one.increments}")
def test_errors_and_levels_are_those_of_the_definitions(window, gyro):
    window = replace(window, gyro=gyro)
    b = np.linspace(1e-3, np.pi, 50)
    fine = np.linspace(1e-4, 1.3, 40001)
    coarse_answers, fine_answers = (answers(window, frequencies) for frequencies in (b, fine))
    for m in range(5):
        # Sums of a few numbers below 10 lose some 1e-15.
        expected = error(window, m, b, coarse_answers)
        np.testing.assert_allclose(responses.errors(window, m, b.tolist()), expected, atol=1e-14)
        # A parabola through three of 1200 frequencies leaves 1e-8 of the largest error.
        largest = error(window, m, fine, fine_answers).max()
        assert responses.level(window, m) == pytest.approx(largest, rel=1e-7, abs=1e-14)


@pytest.mark.parametrize("increments", [1, 2, 5, 20])
def test_what_is_to_be_reached_is_the_spherical_bessel_function(increments):
    b = [0.01, 1.0, 2.0, 3.0]
    grid = BandGrid([REAL.mpf(each) for each in b], 1, increments=increments)
    for m in range(9):
        expected = (-1) ** (m // 2) * increments * (2 * m + 1) * spherical_jn(m, np.array(b) * increments / 2)
        np.testing.assert_allclose([v / ONE for v in grid.bessel(m)], expected, rtol=1e-9, atol=1e-14)


def test_the_noise_gain_is_the_spread_of_a_coefficient():
    window = WINDOWS["window-7-7"]
    assert responses.noise_gain(window, 0) == 1.0
    assert responses.noise_gain(window, 2) ** 2 == pytest.approx(float(sum(t * t for t in window.filters[2])))


def test_the_largest_gain_is_searched_beyond_the_band():
    window = WINDOWS["window-3-3"]
    assert responses.largest_gain(window) == 1.0
    # d_0 + (d_0 - d_1)/2 - (d_-1 - d_0)/2 = 2 d_0 - (d_1 + d_-1)/2: (2 - cos b) s(b).
    row = (0, 0, Fraction(-1, 2), 2, Fraction(-1, 2), 0, 0)
    b = np.linspace(0, np.pi, 20001)
    expected = ((2 - np.cos(b)) * np.sinc(b / 2 / np.pi)).max()
    amplified = replace(window, filters=(row, *window.filters[1:]))
    assert responses.largest_gain(amplified) == pytest.approx(expected, rel=1e-6) and expected > 1.8
    x = 1j * b * 100 / (2 * np.pi * 40)
    shown = np.abs((2 - np.cos(b)) * np.sinc(b / 2 / np.pi) / (1 + 2 * 0.7071 * x + x**2)).max()
    assert responses.largest_gain(replace(amplified, gyro=GYRO)) == pytest.approx(shown, rel=1e-6)


def test_the_polynomial_through_the_samples_is_that_of_other_methods():
    window = WINDOWS["window-3-3"].one_sided_with(0)
    fit = rate_fit.from_increments(1, previous=6)
    for m, row in enumerate(responses.polynomial_fit(window)):
        assert [Fraction(str(weight)) for weight in fit.legendre(m)] == list(row)


def test_bessel_functions_are_those_of_scipy():
    points = [0.0, 1e-6, 0.3, 1.3, 3.0]
    grid = BandGrid([REAL.mpf(b) for b in points], 1)
    for m in range(9):
        sign = (-1) ** (m // 2) * (2 * m + 1)
        expected = sign * spherical_jn(m, np.array(points) / 2)
        np.testing.assert_allclose(
            [value / ONE for value in grid.bessel(m)], expected, rtol=1e-13, atol=1e-300
        )
