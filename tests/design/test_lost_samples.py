"""Filters that restore a lost sample: what they leave within the band, their gains, and that nothing is better."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from strapgen.catalogue.methods.window import GyroResponse
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late.late_filters import POINTS, REACH, WEIGHT, restoration

WINDOW = WINDOWS["window-7-7"]
SAMPLES = np.arange(-REACH, REACH + 1)


def response(taps, frequencies: np.ndarray) -> np.ndarray:
    """Return what a filter makes of the lost sample of e^(ibj), less that sample itself."""
    return np.exp(1j * np.outer(frequencies, SAMPLES)) @ np.array([float(tap) for tap in taps]) - 1


@pytest.mark.parametrize(("which", "gain"), [("lost", 1.8), ("merged", 0.9)])
def test_a_sample_is_restored_within_the_band_at_the_published_gain_of_noise(which, gain):
    taps = getattr(restoration(WINDOW), which)
    assert sum(taps) == 1
    frequencies = np.linspace(0.001, float(WINDOW.band), 300)
    # The weight of the taps, 1e-16, allows for an error of its root times their gain: 2e-8 in the mean; the ends
    # of the band are some ten times worse.
    assert abs(response(taps, frequencies)).max() < 4e-7
    assert abs(response(taps, np.array([2.0]))).max() > 1e-3
    # The sum of two samples is one input, not two.
    inputs = [float(tap) for number, tap in enumerate(taps) if (which, number) != ("merged", REACH + 1)]
    assert np.linalg.norm(inputs) == pytest.approx(gain, abs=0.05)


def test_the_sample_itself_is_not_used_and_the_filter_is_symmetric():
    taps = restoration(WINDOW).lost
    assert taps[REACH] == 0
    assert taps == taps[::-1]
    merged = restoration(WINDOW).merged
    assert merged[REACH] == merged[REACH + 1]


@pytest.mark.long
@pytest.mark.parametrize("which", ["lost", "merged"])
@pytest.mark.parametrize("gyro", [None, GyroResponse(Fraction(10), Fraction(7, 10), Fraction(100))])
def test_no_filter_near_it_has_a_smaller_sum_of_squares(which, gyro):
    window = replace(WINDOW, gyro=gyro)
    taps = np.array([float(tap) for tap in getattr(restoration(window), which)])
    band = float(window.band)
    frequencies = band * np.cos(np.pi * (np.arange(POINTS) + 0.5) / (2 * POINTS))
    shown = np.sinc(frequencies / (2 * np.pi))
    if gyro is not None:
        ratio = frequencies * 100 / (2 * np.pi * 10)
        shown = shown / abs(1 + 1.4j * ratio - ratio**2)

    def squares(filtered: np.ndarray) -> float:
        return float(
            (abs(shown * response(filtered, frequencies)) ** 2).sum() + float(WEIGHT) * filtered @ filtered
        )

    random = np.random.default_rng(5)
    for _ in range(20):
        change = random.standard_normal(2 * REACH + 1)
        change[REACH] = change[REACH + 1] if which == "merged" else 0
        change[REACH - 1] -= change.sum()
        # Where the first power is zero, only the second is left: both signs lose.
        for size in (1e-7, -1e-7):
            assert squares(taps + size * change) > squares(taps)


@pytest.mark.long
def test_the_gyro_counts():
    slow = replace(WINDOW, gyro=GyroResponse(Fraction(5), Fraction(7, 10), Fraction(100)))
    assert restoration(slow) != restoration(WINDOW)
