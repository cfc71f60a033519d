"""The tables of filters that commit late, and the filters that restore a lost sample."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.windows import WINDOWS, with_exact_rotation
from strapgen.design.commit_late.late_filters import (
    NEXT,
    REACH,
    SHORT,
    WEIGHT,
    LateFilters,
    polynomial,
    restoration,
    short_place,
)
from strapgen.design.filters.band_grid import MEAN_POINTS
from strapgen.ir.exceptions import InputError

WINDOW = WINDOWS["window-7-7"]


def test_there_is_a_set_for_every_number_of_samples_before_the_interval():
    filters = LateFilters(WINDOW)
    assert len(filters.sets) == filters.samples == 15
    for previous, rows in enumerate(filters.sets):
        assert (rows == WINDOW.one_sided_with(14 - previous).filters) == (previous >= WINDOW.previous)
    assert filters.sets[:7] == tuple(one.filters for one in WINDOW.start)
    # Without filters of their own for the start, and in words, it has those of the family.
    for calm in (LateFilters(replace(WINDOW, start=())), LateFilters(WINDOW, calm_start=True)):
        assert calm.sets == tuple(WINDOW.one_sided_with(14 - previous).filters for previous in range(15))
    assert filters.sets[7] == WINDOW.filters


@pytest.mark.parametrize(
    ("name", "capacity", "most"), [("window-3-3", 17, 9), ("window-5-5", 19, 14), ("window-7-7", 23, 16)]
)
def test_memory_holds_a_window_with_a_gap(name, capacity, most):
    filters = LateFilters(WINDOWS[name])
    assert (filters.capacity, filters.most_commits) == (capacity, most)


@pytest.mark.parametrize("count", range(1, SHORT + 1))
def test_few_samples_have_the_polynomial_through_them(count):
    filters = LateFilters(WINDOW)
    for place in range(count):
        rows = filters.short[short_place(count, place)]
        fit = rate_fit.from_increments(1, place, count - 1 - place)
        for m, row in enumerate(rows):
            expected = (
                [Fraction(int(w.p), int(w.q)) for w in fit.legendre(m)] if m <= fit.degree else [0] * count
            )
            assert list(row) == expected
    assert polynomial(count, 0, 4) == filters.short[short_place(count, 0)]


def test_the_estimate_of_the_next_sample_is_exact_for_cubic_rates():
    for power in range(1, SHORT + 1):  # the integral of a rate t^(power - 1)
        samples = [Fraction((k + 1) ** power - k**power) for k in range(SHORT + 1)]
        assert sum(tap * sample for tap, sample in zip(NEXT, samples[:-1], strict=True)) == samples[-1]


@pytest.mark.parametrize(
    ("window", "reason"),
    [
        (replace(WINDOW, increments=2), "steps of one sample"),
        (replace(with_exact_rotation(WINDOW), terms=18), "18 terms; one of 16"),
        (WINDOWS["window-8-6"], "whole family"),
    ],
)
def test_other_windows_are_refused(window, reason):
    with pytest.raises(InputError, match=reason):
        LateFilters(window)


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
@pytest.mark.parametrize(
    "gyro", [None, Response(frequency_hz=Fraction(10), damping=Fraction(7, 10), sample_hz=Fraction(100))]
)
def test_no_filter_near_it_has_a_smaller_sum_of_squares(which, gyro):
    window = replace(WINDOW, gyro=gyro)
    taps = np.array([float(tap) for tap in getattr(restoration(window), which)])
    band = float(window.band)
    frequencies = band * np.cos(np.pi * (np.arange(MEAN_POINTS) + 0.5) / (2 * MEAN_POINTS))
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
    slow = replace(
        WINDOW, gyro=Response(frequency_hz=Fraction(5), damping=Fraction(7, 10), sample_hz=Fraction(100))
    )
    assert restoration(slow) != restoration(WINDOW)
