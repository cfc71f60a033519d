"""The kernels of an attitude and heading reference: what they compute."""

from __future__ import annotations

import numpy as np

import strapgen


def test_a_frame_that_is_commanded_turns_the_other_way_in_body_axes():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x of the body along y of the frame
    rate, corrected = strapgen.evaluator("body-feedback")([0.1, 0, 0], turn, [0.02, 0], 0.01, 0.5)
    np.testing.assert_allclose(rate, [0, 0.02, -0.01])
    np.testing.assert_allclose(corrected, [0.1, 0.01, -0.005])
    assert strapgen.evaluator("heading-from-dcm")(turn) == np.pi / 2


def test_a_heading_error_over_the_half_turn_is_the_short_way():
    bias, rate = strapgen.evaluator("heading-loop")(3.0, -3.0, 0.0, 0.5, 0.125, 0.01)
    short = 6 - 2 * np.pi
    np.testing.assert_allclose([bias, rate], [0.01 * 0.125 * short, 0.5 * short], rtol=1e-12)


def test_attitude_mode_is_levelling_without_bias_and_curvature():
    level, erect = strapgen.evaluator("level-loop"), strapgen.evaluator("erection")
    V, change = np.array([0.3, -0.7]), np.array([0.01, 0.02, -0.1])
    velocity, bias, rate = level(V, np.zeros(2), change, np.zeros(2), 0.0, 0.6, 0.01, 0.0, 0.01)
    np.testing.assert_array_equal(bias, 0)
    for one, other in zip((velocity, rate), erect(V, change, 0.6, 0.01, 0.01), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-15)
