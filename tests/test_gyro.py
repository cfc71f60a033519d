"""Gyro pulses: whole, none lost, the same for every back end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import strapgen
from strapgen.exceptions import InputError
from strapgen.gyro import pulses


@given(
    arrays(np.float64, (7, 2, 3), elements=st.floats(-0.1, 0.1)),
    st.floats(1e-6, 0.05),
)
def test_pulses_are_whole_and_carry_what_is_left(increments, size):
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
    backend = make("euler", largest=0.012, carry="full")
    size = 2.0**-12
    run = strapgen.simulate(backend, motion, "0.125", 10, pulse=size)
    # Half a pulse at most on each axis, and as much again for the turning of the axes between steps.
    assert 1e-6 < np.abs(run.drift).max() < 4 * size


def test_pulses_of_the_format_s_unit_reach_fixed_point_exactly(make):
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    backend = make("euler", largest=0.012)
    given_ = pulses(motion.increments(strapgen.fixedpoint.settings.Fraction(1, 8), 80, 2), 2.0**-20)
    np.testing.assert_array_equal(backend.representable(given_).astype(float), given_)
