"""The drift on coning with a weighted sum of older samples: against samples, known designs, and its series."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from strapgen.catalogue.methods import coning_coefficients, coning_drift
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.window import GyroResponse

GYRO = GyroResponse(Fraction(40), Fraction(3, 5), Fraction(100))
SHAPES = [ConingShape(1, 3), ConingShape(3, 0), ConingShape(2, 2, GYRO)]


def response(gyro: GyroResponse | None, b: float) -> complex:
    """Return what the gyro does to the frequency b in rad a sample, from its transfer function."""
    if gyro is None:
        return 1.0
    s = 1j * b * float(gyro.sample_hz)
    w = 2 * math.pi * float(gyro.bandwidth_hz)
    return 1 / (1 + 2 * float(gyro.damping) * s / w + (s / w) ** 2)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("b", [0.3, 1.1, 2.5])
def test_the_drift_is_that_of_cross_products_of_samples(shape, b):
    """On a small cone x + iy of the angles is e^{ibt}; u x v about z is Im(conj(u) v)."""
    coefficients = [Fraction(1, 7), Fraction(-1, 30), Fraction(1, 90)][: shape.unknowns]
    ends = np.exp(1j * b * np.arange(-shape.previous, shape.samples + 1)) * response(shape.gyro, b)
    samples = np.diff(ends)
    lever = sum(float(c) * samples[-1 - s] for s, c in enumerate(coefficients, 1))
    true = (shape.samples * b - math.sin(shape.samples * b)) / 2
    # The computed vector of the step, beside the first-order change of angles, whose own product with them remains.
    computed = (np.conj(lever) * samples[-1]).imag
    start, change = ends[shape.previous], ends[-1] - ends[shape.previous]
    # Half of the angle at the start crossed with the change is what the attitude turns by to second order; its mean
    # over the phase is that of its value here, and for an ideal gyro it is what the true rotation vector leaves out.
    leaves = (np.conj(start) * change).imag / 2
    expected = computed + leaves - shape.samples * b / 2
    (value,) = coning_drift.errors(shape, coefficients, [b])
    assert float(value) == pytest.approx(expected, abs=1e-14)
    if shape.gyro is None:
        assert float(value) == pytest.approx(computed - true, abs=1e-14)


def test_the_largest_drift_of_a_band_is_that_of_its_frequencies_through_the_gyro():
    shape = ConingShape(1, 2, GYRO)
    coefficients = [Fraction(1, 7), Fraction(-1, 30), Fraction(1, 90)][: shape.unknowns]
    values = coning_drift.errors(shape, coefficients, np.linspace(0, 1, 301)[1:].tolist())
    # Between 300 frequencies a peak is higher by the square of 1/600, times half of what bends it, at most 10.
    expected = float(max(map(abs, values)))
    assert coning_drift.largest(shape, coefficients, Fraction(1)) == pytest.approx(expected, rel=3e-5)


@pytest.mark.parametrize(("samples", "previous"), [(1, 1), (1, 5), (4, 0), (3, 3)])
def test_compressed_coefficients_annul_every_power_and_have_their_published_drift(samples, previous):
    design = coning_coefficients.design(samples, previous)
    newest = samples + previous - 1
    coefficients = [design.pairs[newest - s, newest] for s in range(1, newest + 1)]
    shape = ConingShape(samples, previous)
    for row, right in coning_drift.powers(shape, shape.unknowns):
        assert sum(a * c for a, c in zip(row, coefficients, strict=True)) == right
    drift = design.residual()
    for b in (0.5, 2.0):
        expected = sum(float(c) * math.sin(m * b) for m, c in drift.sines.items()) - samples * b / 2
        (value,) = coning_drift.errors(shape, coefficients, [b])
        # The closed form cancels in double precision.
        assert float(value) == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_powers_are_those_of_the_series(shape):
    """Conditions that hold but for 1 leave 1 times the power, with its factor (-1)^q/(2q + 1)!, in E/H."""
    zeros = [Fraction(0)] * shape.unknowns
    with mpmath.workdps(50):

        def drift(b):
            terms, right = coning_drift.terms(shape, b, mpmath)
            h = 1 / abs(mpmath.mpc(response_of(shape.gyro, b))) ** 2 if shape.gyro else 1
            return -right * h if not any(zeros) else terms

        series = mpmath.taylor(drift, 0, 7)
    for q, (_, right) in enumerate(coning_drift.powers(shape, 3), 1):
        power = 2 * q + 1
        expected = -float(right) * (-1) ** q / math.factorial(power)
        assert float(series[power]) == pytest.approx(expected, rel=1e-12)


def response_of(gyro, b):
    """Return the response as `response` does, in many digits, with the rational for pi that the conditions have."""
    x = b * mpmath.mpf(gyro.sample_hz.numerator) / gyro.sample_hz.denominator
    pi = mpmath.mpf(coning_drift.PI.numerator) / coning_drift.PI.denominator
    s = (
        mpmath.mpc(0, 1)
        * x
        / (2 * pi * mpmath.mpf(gyro.bandwidth_hz.numerator) / gyro.bandwidth_hz.denominator)
    )
    return 1 / (1 + 2 * mpmath.mpf(gyro.damping.numerator) / gyro.damping.denominator * s + s**2)
