"""Magnus series on more samples than their order needs: nothing of the coning that these show is lost."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from strapgen import backend, derive, motion, simulate
from strapgen.kernel.kernel import Kernel

#: Samples of a step, and those before it.
SAMPLES = pytest.mark.parametrize(
    ("count", "previous"), [(1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (8, 0), (1, 3), (3, 2)]
)
SAMPLE_S = Fraction(1, 100)


def second_order(kernel: Kernel) -> list:
    """Return the terms of second order in the increments of the rotation vector that a kernel computes."""
    names = kernel.inputs[0].elements
    ring, *generators = sp.ring(names, sp.QQ)
    values = kernel.expand(dict(zip(names, generators, strict=True)))["rotation_vector"]
    return [
        sum((ring({powers: c}) for powers, c in ring(element).terms() if sum(powers) == 2), ring(0))
        for element in values
    ]


def drift_deg(method: str, count: int, previous: int, frequency_hz: float) -> float:
    """Return the drift in a second on a cone of half-angle 1 degree, sampled at 100 Hz."""
    half_angle, omega = np.radians(1), 2 * np.pi * frequency_hz
    cone = motion(
        "coning",
        a_rad_s=omega * np.sin(half_angle),
        b_rad_s=omega,
        g_rad_s=-omega * (1 - np.cos(half_angle)),
    )
    step = SAMPLE_S * count
    run = simulate(backend("euler", method, count, previous=previous), cone, step, step * (100 // count))
    return float(np.degrees(run.mean_drift))


@pytest.mark.parametrize(
    ("count", "previous"),
    [
        (1, 0),
        (3, 0),
        (1, 3),
        *(pytest.param(n, p, marks=pytest.mark.long) for n, p in ((2, 0), (4, 0), (5, 0), (8, 0), (3, 2))),
    ],
)
@pytest.mark.parametrize("method", ["magnus4", "magnus6"])
def test_the_term_of_second_order_is_that_of_the_polynomial_through_the_samples(method, count, previous):
    kernel = derive("rotation-vector", method, count, previous=previous)
    exact = derive("rotation-vector", "coning-uncompressed", count, previous=previous)
    assert second_order(kernel) == second_order(exact)


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "previous", "counts", "factor"),
    [
        ("magnus6", 0, (3, 4), 2),
        pytest.param("magnus6", 0, (4, 5), 2, marks=pytest.mark.long),
        ("magnus4", 0, (2, 3), 1.3),
        pytest.param("magnus4", 0, (3, 4), 20 / 13, marks=pytest.mark.long),
        # Samples before the step help as well.
        pytest.param("magnus6", 2, (2, 3), 2, marks=pytest.mark.long),
        pytest.param("magnus6", 2, (3, 4), 1, marks=pytest.mark.long),
    ],
)
def test_at_a_sampling_rate_more_samples_a_step_drift_less(method, previous, counts, factor):
    for frequency_hz in (2, 5, 10):
        fewer, more = (drift_deg(method, count, previous, frequency_hz) for count in counts)
        assert fewer > factor * more
