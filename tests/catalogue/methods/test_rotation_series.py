"""The rotation vector as a series in the rate: its exponential is the true rotation, and its forms are equal."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import factorial
from random import Random

import numpy as np
import pytest
import sympy as sp
from peano_baker import Series, generic_rate, lowest_difference, matrix, rotation

from strapgen import backend, derive, motion, simulate
from strapgen.catalogue.methods import rotation_series
from strapgen.catalogue.methods.rotation_series import legendre_terms, terms
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross_elements, dot
from strapgen.kernel.kernel import Kernel, evaluate_stages


def vectors(count: int) -> list[list[Fraction]]:
    random = Random(1969)
    return [[Fraction(random.randint(-9, 9), random.randint(1, 9)) for _ in range(3)] for _ in range(count)]


def value(words, among) -> np.ndarray:
    """Return a sum of words, the nested products carried out."""
    total = np.array([Fraction(0)] * 3)
    for word, c in words.items():
        nested = among[word[-1]]
        for letter in reversed(word[:-1]):
            nested = cross_elements(among[letter], nested)
        total = total + c * np.array(nested)
    return total


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_exponential_of_the_terms_is_the_true_rotation(order):
    # In powers of a factor of the rate: nested integrals (Peano, Baker) know nothing of cross products.
    rate, top = generic_rate(3), order + 1
    found = [value(words, [list(c) for c in rate]) for words in terms(4, order)]
    phi = [Series({m: v[axis] for m, v in enumerate(found, 1)}, top) for axis in range(3)]
    A = np.array(matrix("euler", phi), object)
    zero, one = Series({}, top), Series({0: 1}, top)
    power = total = np.array([zero, zero, zero, one], object)
    for k in range(1, top + 1):
        power = A @ power
        total = total + power * Fraction(1, factorial(k))
    true = rotation("euler", [[Series({1: x}, top) for x in c] for c in rate], top)
    assert lowest_difference(list(total), true) == top


def test_known_terms():
    # r_0 x r_1 has 1/12 (half a step before its middle counts as much as half a step behind it), r_0 x r_2 the same.
    found = rotation_series.pairs(terms(3, 2)[1])
    assert found == {(0, 1): Fraction(1, 12), (0, 2): Fraction(1, 12), (1, 2): Fraction(1, 60)}


def test_reversed_in_time_a_term_changes_its_sign():
    # In Legendre polynomials, even or odd about the middle: only where order and degrees add up to an odd number is
    # something left, and in the second order only of neighbours.
    _, second, third, fourth = legendre_terms(5, 4)
    assert {j - i for i, j in rotation_series.pairs(second)} == {1}
    for k, row in rotation_series.third_order(third).items():
        assert all((k + i + j) % 2 == 0 for i, j in row)
    for (k, m), row in rotation_series.fourth_order(fourth).items():
        assert all((k + m + i + j) % 2 for i, j in row)


def test_words_multiply_as_cross_products():
    among = vectors(4)
    for lengths in product((1, 2, 3), repeat=2):
        left, right = (
            {tuple(word): Fraction(c) for word, c in zip(some, (2, -3), strict=True)}
            for some in ([[0, 1, 2][:n], [3, 1, 0][:n]] for n in lengths)
        )
        wanted = cross_elements(value(left, among), value(right, among))
        assert list(value(rotation_series.cross_words(left, right), among)) == wanted


@pytest.mark.parametrize("count", [2, 5])
def test_scalar_products_give_the_same_terms(count):
    among = vectors(count)
    _, second, third, fourth = terms(count, 4)

    def weight(row) -> Fraction:
        return sum(c * dot(among[i], among[j]) for (i, j), c in row.items())

    def crossed(k, m) -> np.ndarray:
        return np.array(cross_elements(among[k], among[m]))

    pairs = rotation_series.pairs(second)
    assert list(sum(c * crossed(*pair) for pair, c in pairs.items())) == list(value(second, among))
    rows = rotation_series.third_order(third)
    assert list(sum(weight(row) * np.array(among[k]) for k, row in rows.items())) == list(value(third, among))
    rows = rotation_series.fourth_order(fourth)
    assert list(sum(weight(row) * crossed(*pair) for pair, row in rows.items())) == list(value(fourth, among))


def rotation_vector(kernel: Kernel) -> list:
    """Return the rotation vector of a step as polynomials in the elements of its increments, and these."""
    names = kernel.inputs[1].elements
    ring, *generators = sp.ring(names, sp.QQ)
    place = next(k for k, stage in enumerate(kernel.stages) if stage.signal.name == "phi")
    known = evaluate_stages(kernel.stages[: place + 1], dict(zip(names, generators, strict=True)))
    vectors = np.array(generators, object).reshape(-1, 3)
    return [ring(known[f"phi_{axis}"]) for axis in "xyz"], vectors


@pytest.mark.long
def test_the_published_coning_correction_of_two_increments():
    # J. W. Jordan, NASA TN D-5384 (1969); R. B. Miller, J. Guid. Control Dyn. 6 (1983) 287: 2/3 of the cross product.
    found, (d1, d2) = rotation_vector(derive("euler", "magnus4", 2))
    cross = algebra.cross_elements(list(d1), list(d2))
    assert found == [a + b + sp.Rational(2, 3) * c for a, b, c in zip(d1, d2, cross, strict=True)]


@pytest.mark.long
def test_the_published_coning_correction_with_one_previous_increment():
    # 1/12 of the previous increment times the present one: the two-sample algorithm of a slow gyro (Jordan 1969).
    found, (past, d) = rotation_vector(derive("euler", "magnus4", 1, previous=1))
    cross = algebra.cross_elements(list(past), list(d))
    assert found == [a + sp.Rational(1, 12) * c for a, c in zip(d, cross, strict=True)]


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
