"""The filters of pairs of samples: designed again, their levels, and what they are exact for."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp
from boundary_design import designed

import strapgen
from strapgen.pipeline import program
from strapgen.stamped.boundary_kernels import FARTHEST, filters
from strapgen.stamped.kernel_names import ROUNDS, WITH_SLOPE, WITHOUT_SLOPE, kernel_name

BAND = Fraction(13, 10)
#: Levels of rate and slope over the band; those of 7 pairs are 2.25e-7 and 2.19e-8 in a design by weighted squares.
LEVELS = {3: (3.6114e-3, 9.511e-4), 5: (2.40937e-5, 3.43418e-6), 7: (2.25087e-7, 2.19054e-8)}


@pytest.mark.parametrize("pairs", LEVELS)
@pytest.mark.parametrize("is_slope", [False, True])
def test_a_design_gives_the_stored_weights_again(pairs, is_slope):
    weights, level = designed(pairs, is_slope, BAND)
    assert filters(pairs)[is_slope] == weights
    assert level == pytest.approx(LEVELS[pairs][is_slope], rel=1e-4)


@pytest.mark.parametrize("pairs", [1, 2, *LEVELS])
def test_a_correction_is_exact_for_a_rate_of_low_degree(pairs):
    # The rate is a polynomial with symbols as coefficients; without the slope its mean is that at the boundary.
    degree = {1: 1, 2: 3}.get(pairs, 3)
    t, offset = sp.symbols("t offset")
    coefficients = sp.symbols(f"c0:{degree + 1}")
    rate = sum(c * t**k for k, c in enumerate(coefficients))
    kernel = strapgen.derive(kernel_name(pairs))
    samples = [sp.integrate(rate, (t, k, k + 1)) for k in range(-pairs, pairs)]
    values = {f"d{k + 1}_{axis}": sample for k, sample in enumerate(samples) for axis in "xyz"}
    (e_x, *_) = kernel.expand({**values, "offset": offset})["correction"]
    expected = coefficients[0] * offset
    if pairs in WITH_SLOPE:
        expected += coefficients[1] * offset**2 / 2
    assert sp.expand(e_x - expected) == 0


def test_a_sample_costs_the_multiplications_that_the_formula_has():
    counts = {
        pairs: program(strapgen.choose(kernel_name(pairs))).operations["multiply"] for pairs in (3, 5, 7)
    }
    # Three weights and the offset for each axis; five weights of both kinds, two factors, and half the offset.
    assert counts == {3: 12, 5: 37, 7: 49}


@pytest.mark.parametrize("pairs", [1, 2, *LEVELS])
def test_the_largest_correction_is_reached_and_not_exceeded(pairs):
    evaluate = strapgen.evaluator(kernel_name(pairs))
    weights, far = filters(pairs), float(FARTHEST)
    slope = pairs in WITH_SLOPE
    sums = [float(g + slope * FARTHEST / 2 * k) for g, k in zip(*weights, strict=True)]
    differences = [float(g - slope * FARTHEST / 2 * k) for g, k in zip(*weights, strict=True)]
    signs = [1 if w > 0 else -1 for w in (*differences[::-1], *sums)]
    reached = evaluate([[sign] * 3 for sign in signs], far)[0]
    assert reached <= float(weights.largest) * (1 + 1e-12)
    assert reached > float(weights.largest) * 0.9


def test_the_rounds_have_kernels():
    assert {pairs for both in ROUNDS for pairs in both} | {1, 2} == {*WITH_SLOPE, *WITHOUT_SLOPE}
