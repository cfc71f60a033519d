"""The noise of quantized increments: closed forms, the figures that follow from them, and random samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import catalogue
from strapgen.ir.exceptions import InputError
from strapgen.lab.quantization_noise import (
    PULSE,
    RATE,
    STEP,
    TIME,
    extraction_noise,
    polynomial_noise,
    quantization_noise,
)

c = sp.Symbol("c")
THIRD = sp.Rational(1, 3)
ARCSEC = math.radians(1 / 3600)
#: A run of the thesis with the quantum 0.007 deg, about an axis: pulse, rate, step and duration.
RUN = {PULSE: 25.2 * ARCSEC, RATE: math.radians(10), STEP: 0.125, TIME: 180}


def vectors(count: int) -> list[sp.Matrix]:
    return [sp.Matrix(sp.symbols(f"d{k}x d{k}y d{k}z")) for k in range(count)]


def arcsec(variance: sp.Expr) -> float:
    return math.sqrt(variance.subs(RUN)) / ARCSEC


def step(factor: object):
    """Return the noise of the step d1 + d2 + c d1 x d2."""
    first, second = vectors(2)
    return polynomial_noise(first + second + factor * first.cross(second), [first, second])


def test_the_closed_form_for_any_coefficient_of_the_cross_product():
    noise = step(c)
    q, w, h, t = PULSE, RATE, STEP, TIME
    wanted = 2 * q**2 / 12 + q**2 / 12 * ((1 - c) ** 2 + c**2) * w**2 * h * t
    assert sp.expand(noise.across(2) - wanted) == 0
    assert sp.expand(noise.along(2) - 2 * q**2 / 12) == 0
    assert sp.expand(noise.across() - wanted + q**2 / 12) == 0, "the first angle is exact"
    assert sp.solve(sp.diff(noise.turning, c), c) == [sp.Rational(1, 2)], "the least"


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "method", "increments", "previous", "turning"),
    [
        ("euler", "rk2", 2, 0, 5),
        ("dcm", "rk2", 2, 0, 5),
        ("euler", "rk4", 2, 0, 5 * THIRD**2),
        ("dcm", "rk4", 2, 0, 5 * THIRD**2),
        ("dcm", "magnus4", 2, 0, 5 * THIRD**2),
        ("euler", "rk4", 1, 1, 1),  # the half step of d2 = 0 at c = 0 is the step itself
    ],
)
def test_the_factor_of_a_step_comes_from_its_kernel(algorithm, method, increments, previous, turning):
    noise = quantization_noise(catalogue.choose_step(algorithm, method, increments, previous=previous))
    assert (noise.walk, noise.turning, noise.start, noise.end) == (0, turning, 1, 1)


@pytest.mark.parametrize("fast_cycles", [1, 2, 5])
def test_two_speeds_make_the_noise_of_their_fast_cycle(fast_cycles):
    before, *rest = vectors(1 + fast_cycles)
    angle = coning = sp.zeros(3, 1)
    increments = [before, *rest]
    for earlier, increment in zip(increments, rest, strict=False):
        coning += (angle + earlier / 6).cross(increment) / 2  # (26) of the lecture on strapdown algorithms
        angle += increment
    noise = polynomial_noise(angle + coning, increments, previous=1)
    # h = s times the fast cycles: (q^2/12) w^2 s t, that of c = 1/2 at a step of two fast cycles.
    assert (noise.walk, noise.turning * fast_cycles) == (0, 1)


def test_rates_at_the_nodes():
    for node, variance in (
        (0, sp.Rational(26, 12)),
        (sp.Rational(1, 2), sp.Rational(2, 12)),
        (1, sp.Rational(26, 12)),
    ):
        assert sp.expand(extraction_noise(2, sp.sympify(node)) ** 2 - variance * PULSE**2 / STEP**2) == 0
    numbers = [float(extraction_noise(2, sp.sympify(node)) * STEP / PULSE) for node in (0, "1/2", 1)]
    assert numbers == pytest.approx([1.47196, 0.408248, 1.47196], abs=5e-6)


def test_figures_at_ten_degrees_per_second():
    across = [arcsec(step(factor).across()) for factor in (0, sp.Rational(1, 2), 2 * THIRD, 2)]
    assert across == pytest.approx([9.4441, 8.4294, 8.5481, 15.3060], abs=5e-5)
    assert arcsec(step(c).along()) == pytest.approx(7.2746, abs=5e-5)
    walk = quantization_noise(catalogue.choose_step("dcm", "rk1", 2))
    assert walk.walk == 32
    # The ends add under a ten-thousandth, which the closed form q sqrt(8 N/3) leaves out.
    assert 25.2 * math.sqrt(walk.walk * 1440 / 12) == pytest.approx(1561.587, abs=5e-4)
    assert arcsec(walk.along()) == pytest.approx(1561.587, rel=1e-4)


def test_unsuitable_polynomials_are_refused():
    first, second = vectors(2)
    with pytest.raises(InputError, match="is left"):
        polynomial_noise(first + second + sp.Matrix([first[0] * second[0], 0, 0]), [first, second])
    with pytest.raises(InputError, match="none lies in the step"):
        polynomial_noise(first + second, [first, second], previous=2)
    with pytest.raises(InputError, match="takes no increments"):
        quantization_noise(catalogue.choose_step("euler", "rk4", rates=True))


def exact_runs(factor: float, errors: np.ndarray) -> np.ndarray:
    """Turn exactly by d1 + d2 + c d1 x d2 from increments with errors; return the angles from the truth, (runs, 3)."""
    runs, samples, _ = errors.shape
    pace = np.array([0.0, 0.0, RUN[RATE] * RUN[STEP] / 2])
    increments = np.diff(errors, axis=1) + pace
    vector, scalar = np.zeros((runs, 3)), np.ones((runs, 1))
    for k in range(0, samples - 1, 2):
        first, second = increments[:, k], increments[:, k + 1]
        phi = first + second + factor * np.cross(first, second)
        half = np.linalg.norm(phi, axis=1, keepdims=True) / 2
        v, s = phi / (2 * half) * np.sin(half), np.cos(half)
        vector, scalar = (
            scalar * v + s * vector + np.cross(vector, v),
            scalar * s - (vector * v).sum(axis=1, keepdims=True),
        )
    turned = RUN[RATE] * RUN[TIME] / 2
    true_vector, true_scalar = np.array([0, 0, math.sin(turned)]), math.cos(turned)
    # The rotation from the true to the computed attitude, in reference axes: q times the conjugate of the truth.
    error = vector * true_scalar - scalar * true_vector - np.cross(vector, true_vector)
    sign = np.sign(scalar * true_scalar + (vector * true_vector).sum(axis=1, keepdims=True))
    return 2 * sign * error


@pytest.mark.long
@pytest.mark.parametrize("factor", [0, 1 / 2, 2 / 3, 2])
def test_random_samples_have_the_derived_noise(factor):
    errors = np.random.default_rng(7).uniform(-0.5, 0.5, (400, 2881, 3)) * RUN[PULSE]
    errors[:, 0] = 0.0
    angles = exact_runs(factor, errors) / ARCSEC
    noise = step(sp.nsimplify(factor))
    # 800 numbers across: their deviation is known to 2.5 %, that of the 400 along to 3.5 %.
    assert np.sqrt(np.square(angles[:, :2]).mean()) == pytest.approx(arcsec(noise.across()), rel=0.08)
    assert np.sqrt(np.square(angles[:, 2]).mean()) == pytest.approx(arcsec(noise.along()), rel=0.08)


@pytest.mark.long
@pytest.mark.parametrize("method", ["rk1", "rk2", "rk4"])
def test_random_samples_through_a_generated_step(method):
    backend = strapgen.backend("euler", method, 2)
    errors = np.random.default_rng(8).uniform(-0.5, 0.5, (400, 2881, 3)) * RUN[PULSE]
    errors[:, 0] = 0.0
    increments = np.full((400, 2880, 3), [0, 0, RUN[RATE] * RUN[STEP] / 2])
    exact = backend.propagate(increments[:1].reshape(1, 1440, 2, 3), 1440)[0, -1]
    ends = backend.propagate((increments + np.diff(errors, axis=1)).reshape(400, 1440, 2, 3), 1440)[:, -1]
    true, computed = (backend.matrices(states) for states in (exact, ends))
    error = computed @ true.T / (exact @ exact) ** 2  # a matrix is as long as the square of its state
    angles = (
        np.stack([error[:, j, i] - error[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1) / 2 / ARCSEC
    )
    noise = quantization_noise(catalogue.choose_step("euler", method, 2))
    assert np.sqrt(np.square(angles[:, :2]).mean()) == pytest.approx(arcsec(noise.across()), rel=0.08)
    assert np.sqrt(np.square(angles[:, 2]).mean()) == pytest.approx(arcsec(noise.along()), rel=0.08)
