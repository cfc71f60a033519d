"""Gyro pulses: whole, none lost, the same for every back end."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tolerances import certified

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.run.increments import pulses, windows


@given(
    arrays(np.float64, (7, 2, 3), elements=st.floats(-0.1, 0.1)),
    st.floats(1e-6, 0.05),
)
def test_pulses_are_whole_and_carry_the_remainder(increments, size):
    given_ = pulses(increments, size)
    assert given_.shape == increments.shape
    counts = given_ / size
    np.testing.assert_allclose(counts, np.rint(counts), rtol=0, atol=1e-9)
    # The angle since the start is off by at most half a pulse, whatever happened before.
    behind = np.cumsum((given_ - increments).reshape(-1, 3), axis=0)
    assert np.abs(behind).max() <= size / 2 * (1 + 1e-9) + 1e-15


def test_runs_are_quantized_one_by_one(rng):
    increments = rng.normal(scale=0.01, size=(3, 5, 2, 3))
    together = pulses(increments, "1e-3")
    for run in range(3):
        np.testing.assert_array_equal(together[run], pulses(increments[run], "1e-3"))


def test_runs_that_keep_increments_are_quantized_one_by_one(rng):
    rows = rng.normal(scale=0.01, size=(3, 12, 3))
    runs = np.stack([windows(row, 2, 2) for row in rows])
    together = pulses(runs, "1e-3", 2)
    for run in range(3):
        np.testing.assert_array_equal(together[run], pulses(runs[run], "1e-3", 2))


def test_nothing_is_quantized_without_steps():
    assert pulses(np.zeros((0, 2, 3)), 1).shape == (0, 2, 3)


@pytest.mark.parametrize(
    ("size", "said"),
    [(0, "pulse is 0"), (-1, "pulse is -1"), ("x", "pulse is 'x'"), (1e-300, "more pulses than")],
)
def test_pulses_that_cannot_be_counted(size, said):
    with pytest.raises(InputError, match=said):
        pulses(np.full((4, 2, 3), 0.1), size)


def test_the_simulator_feeds_pulses_to_every_back_end(make):
    motion = strapgen.motion("constant", x_deg_s=10, y_deg_s=-7, z_deg_s=3)
    backend = make("euler", largest=0.011, carry="full")
    size = 2.0**-12
    run = strapgen.simulate(backend, motion, "0.125", 10, pulse=size)
    # Half a pulse at most on each axis, and as much again for the turning of the axes between steps.
    assert 1e-6 < np.abs(run.drift).max() < 4 * size


def test_pulses_of_the_format_s_unit_reach_fixed_point_exactly(make):
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    backend = make("euler", largest=0.011)
    given_ = pulses(motion.increments(strapgen.ir.fixed_settings.Fraction(1, 8), 80, 2), 2.0**-20)
    np.testing.assert_array_equal(backend.representable(given_).astype(float), given_)


# Increments kept for later steps

COUNTS = st.tuples(st.integers(0, 5), st.integers(1, 4), st.integers(0, 3))


@given(COUNTS, st.randoms(use_true_random=False))
def test_windows_are_the_row_step_after_step(counts, random):
    steps, count, previous = counts
    row = np.array([[random.random() for _ in "xyz"] for _ in range(previous + steps * count)]).reshape(-1, 3)
    cut = windows(row, count, previous)
    assert cut.shape == (steps, previous + count, 3)
    for k, window in enumerate(cut):
        np.testing.assert_array_equal(window, row[k * count : k * count + previous + count])
    # What a step keeps is what the steps before it took, whole.
    np.testing.assert_array_equal(cut[:, previous:].reshape(-1, 3), row[previous:])


@pytest.mark.parametrize(("count", "previous"), [(1, 1), (1, 3), (2, 1), (2, 3), (4, 2)])
def test_windows_overlap_consistently(count, previous, rng):
    cut = windows(rng.normal(size=(previous + 6 * count, 3)), count, previous)
    for before, after in pairwise(cut):
        np.testing.assert_array_equal(before[count:], after[:previous])


@pytest.mark.parametrize("previous", [0, 1, 3])
@pytest.mark.parametrize("count", [1, 2, 4])
def test_no_steps_make_no_windows(count, previous):
    none = windows(np.zeros((previous, 3)), count, previous)
    assert none.shape == pulses(none, 1, previous).shape == (0, previous + count, 3)


@given(
    arrays(np.float64, (14, 3), elements=st.floats(-0.1, 0.1)),
    st.floats(1e-6, 0.05),
    st.sampled_from([(1, 1), (1, 3), (2, 2), (3, 2), (4, 2)]),
)
def test_pulses_of_overlapping_steps_are_those_of_the_row(row, size, counts):
    count, previous = counts
    steps = (len(row) - previous) // count
    used = row[: previous + steps * count]
    cut = windows(used, count, previous)
    given_ = pulses(cut, size, previous)
    assert given_.shape == cut.shape
    # One gyro counts: an increment is the same number of pulses in every step that takes it.
    alone = pulses(used[:, None], size)[:, 0]
    np.testing.assert_array_equal(given_, windows(alone, count, previous))
    # Every sum of increments in a row is off by at most a pulse, from wherever it begins.
    off = np.cumsum(np.concatenate([np.zeros((1, 3)), alone - used]), axis=0)
    assert np.ptp(off, axis=0).max() <= size * (1 + 1e-9) + 1e-15
    within = np.cumsum(given_ - cut, axis=1)
    assert np.abs(within).max() <= size * (1 + 1e-9) + 1e-15


def test_the_simulator_feeds_pulses_to_steps_that_keep_increments(backend_name):
    motion = strapgen.motion("constant", x_deg_s=10, y_deg_s=-7, z_deg_s=3)
    backend = strapgen.backend("euler", "rk4", 1, backend_name, previous=2)
    size = 2.0**-12
    run = strapgen.simulate(backend, motion, "0.0625", 5, pulse=size)
    # As without previous ones, with a pulse more that the fit spreads over the step, and what is rounded.
    assert 1e-6 < np.abs(run.drift).max() < 8 * size + 2 * certified(backend, 80)
