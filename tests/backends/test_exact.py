"""Arithmetic of many digits: the reference itself."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from derived import program

import strapgen
from strapgen.backends import exact
from strapgen.catalogue import Choice


@pytest.mark.parametrize("method", ["rk1", "rk4"])
def test_exact_runs_are_those_of_rationals(algorithm, method, rng):
    made = program(Choice(algorithm, method, 2))
    increments = rng.normal(scale=0.01, size=(3, 2, 3))
    state = list(made.companions.identity)
    for row in increments.reshape(3, -1).tolist():
        values = dict(zip(made.inputs[0].elements, state, strict=True))
        values |= zip(made.inputs[1].elements, map(Fraction, row), strict=True)
        (state,) = made.run(values).values()
    wanted = np.array([float(element) for element in state])
    np.testing.assert_array_equal(exact.propagate(made, increments)[-1].ravel(), wanted)


def test_double_is_near_the_exact_run(algorithm, rng):
    increments = rng.normal(scale=0.01, size=(200, 2, 3))
    wanted = exact.propagate(program(Choice(algorithm, "rk4", 2)), increments)
    computed = strapgen.backend(algorithm, backend="numpy").propagate(increments)
    # 16 units of round-off a step bound the rounding in double.
    assert np.abs(computed - wanted).max() <= 200 * 16 * 2.0**-53
    start = wanted[100]
    rest = exact.propagate(program(Choice(algorithm, "rk4", 2)), increments[100:], start)
    assert np.abs(rest[-1] - wanted[-1]).max() <= 8 * 2.0**-53


def test_only_steps_are_run():
    with pytest.raises(ValueError, match="error_matrix is no attitude step"):
        exact.propagate(program(Choice("error-matrix")), np.zeros((1, 2, 3)))
