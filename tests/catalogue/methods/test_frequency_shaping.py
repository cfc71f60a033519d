"""Coning coefficients by least squares over a band: what they leave of coning, and that nothing leaves less."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.catalogue.methods import coning_coefficients
from strapgen.catalogue.methods.coning import BAND, weights

SAMPLES = pytest.mark.parametrize(("increments", "previous"), [(1, 1), (1, 4), (1, 8), (3, 3), (4, 0)])


def columns(increments: int, previous: int, b: np.ndarray) -> np.ndarray:
    """Return what a weight of 1 on each older sample gives on coning, the youngest first."""
    return np.stack([2 * np.sin(s * b) * (1 - np.cos(b)) for s in range(1, increments + previous)], -1)


def target(increments: int, b: np.ndarray) -> np.ndarray:
    return (increments * b - np.sin(increments * b)) / 2


@SAMPLES
def test_no_other_weights_leave_a_smaller_mean_square(increments, previous):
    """What is left is orthogonal to every column, to the rounding of the columns and of the weights."""
    nodes, parts = np.polynomial.legendre.leggauss(60)
    b = float(BAND) / 2 * (1 + nodes)
    table = columns(increments, previous, b)
    left = table @ [float(weight) for weight in weights(increments, previous)] - target(increments, b)
    scale = np.sqrt(parts @ table**2) * np.sqrt(parts @ target(increments, b) ** 2)
    np.testing.assert_allclose((parts * left) @ table / scale, 0, atol=1e-14)


@SAMPLES
def test_the_mean_square_is_below_that_of_coefficients_for_low_frequencies(increments, previous):
    b = np.linspace(0.01, float(BAND), 500)
    pairs = coning_coefficients.design(increments, previous).pairs
    newest = increments + previous - 1
    annulling = [float(pairs.get((newest - s, newest), 0)) for s in range(1, increments + previous)]
    shaped = [float(weight) for weight in weights(increments, previous)]
    table, exact = columns(increments, previous, b), target(increments, b)
    sizes = [np.sqrt(np.mean((table @ k - exact) ** 2)) for k in (shaped, annulling)]
    assert sizes[0] < 0.7 * sizes[1]


def test_one_sample_has_nothing_to_be_crossed_with():
    assert weights(1) == ()
    turn = np.array([[[0.1, 0.2, 0.3]]])
    single, plain = (strapgen.backend("euler", m, 1) for m in ("coning-least-squares", "coning-compressed"))
    np.testing.assert_array_equal(single.propagate(turn), plain.propagate(turn))
