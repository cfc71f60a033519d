"""What filters do, against sums in double precision over frequencies, and how their taps are rounded."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from scipy.special import spherical_jn

from strapgen.catalogue.methods import rate_fit, windows
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.filters import responses
from strapgen.design.filters.band_grid import ONE, REAL, BandGrid
from strapgen.design.filters.filter_taps import Shape, Unknowns, in_words, rounded
from strapgen.ir.exceptions import InputError

GYRO = Response(frequency_hz=Fraction(40), damping=Fraction(7071, 10000), sample_hz=Fraction(100))


def answers(window, b):
    """Return what the samples of a window are for a unit of rate at frequencies, (n, samples)."""
    j = np.arange(window.total_increments) - window.previous
    gyro = np.ones_like(b, dtype=complex)
    if window.gyro is not None:
        x = 1j * b * float(window.gyro.sample_hz) / (2 * np.pi * float(window.gyro.frequency_hz))
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
def test_ideal_response_is_the_spherical_bessel_function(increments):
    b = [1e-6, 0.01, 1.0, 2.0, 3.0]
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


def test_rationals_at_thirty_digits_are_those_that_are_known():
    taps = rounded(Unknowns(Shape(3, 3, 4), 1), WINDOWS["window-3-3"].filters[1], 30)
    known = ["3292544549/8053063680", "-200490913/2013265920", "7214415/536870912"]
    assert list(taps[4:]) == [Fraction(text) for text in known]
    assert list(taps[:4]) == [*(-Fraction(text) for text in reversed(known)), 0]


@pytest.mark.parametrize(
    "shape", [Shape(5, 5, 4), Shape(4, 2, 5), Shape(3, 3, 3, GYRO)], ids=["symmetric", "one", "gyro"]
)
def test_conditions_hold_exactly_whatever_is_rounded(shape, rng):
    for m in range(4):
        unknowns = Unknowns(shape, m)
        taps = rounded(unknowns, list(rng.normal(size=shape.samples)), 12)
        for row, right in zip(unknowns.rows, unknowns.right, strict=True):
            total = sum(c * x for c, x in zip(row, unknowns.values(taps), strict=True))
            assert total == right
        assert all((tap * 2**12).denominator == 1 for tap in unknowns.values(taps)[unknowns.inner :])


@pytest.mark.long
@pytest.mark.parametrize(("name", "bits"), [("window-3-3", 15), ("window-5-5", 24), ("window-4-2", 24)])
def test_words_hold_the_sum_and_the_first_moment_exactly(name, bits):
    window = WINDOWS[name]
    words = in_words(window, bits)
    windows.verify(words)
    assert words.conditions == 2 and words.parity == window.parity
    unit = Fraction(1, 2**bits)
    for m, (row, exact) in enumerate(zip(words.filters, window.filters, strict=True)):
        assert all((tap / unit).denominator == 1 for tap in row)
        # A free tap moves by a unit and a half; the inner ones answer by the polynomial through them.
        assert max(abs(a - b) for a, b in zip(row, exact, strict=True)) < 100 * unit, m


@pytest.mark.long
def test_no_other_word_of_a_free_tap_has_a_smaller_error():
    # F_1 with sum j F_j = 1/4 exactly, and the second tap nearest to sum j^3 F_j = 3/80 - 1/16, both by hand.
    window, bits = WINDOWS["window-5-5"], 20
    unit = Fraction(1, 2**bits)
    cubic = sum(j**3 * tap for j, tap in enumerate(window.filters[1][6:], 1))
    free = [round(tap / unit) for tap in window.filters[1][8:]]
    levels = {}
    for move in product((-1, 0, 1), repeat=3):
        outer = [(a + b) * unit for a, b in zip(free, move, strict=True)]
        rest = [sum(j**power * tap for j, tap in enumerate(outer, 3)) for power in (1, 3)]
        # x_1 + 2 x_2 = 1/4 - rest, x_1 + 8 x_2 = cubic - rest.
        second = round(((cubic - rest[1]) - (Fraction(1, 4) - rest[0])) / 6 / unit) * unit
        half = (Fraction(1, 4) - rest[0] - 2 * second, second, *outer)
        row = (*(-tap for tap in reversed(half)), Fraction(0), *half)
        levels[row] = responses.level(replace(window, filters=(window.filters[0], row)), 1)
    chosen = in_words(window, bits).filters[1]
    # The search has fewer frequencies: between them an error rises by less than 1 part in 1000.
    assert levels[chosen] <= 1.001 * min(levels.values()) < 0.9 * max(levels.values())


def test_words_need_a_symmetric_filter_for_equal_sides():
    window = WINDOWS["window-3-3"]
    row = (Fraction(1), *window.filters[1][1:])
    with pytest.raises(InputError, match="has no symmetry"):
        in_words(replace(window, filters=(window.filters[0], row)), 30)
    with pytest.raises(InputError, match="bits is 1; a whole number from 2 to 128 is needed"):
        in_words(window, 1)
