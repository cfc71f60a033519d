"""The tables of filters that commit late: their sizes, those on few samples, and the windows that have none."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.windows import WINDOWS, with_exact_rotation
from strapgen.design.commit_late.late_filters import NEXT, SHORT, LateFilters, polynomial, short_place
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
