"""Sums of shifted oscillations: as complex numbers, and their response as it is computed step by step."""

from __future__ import annotations

import cmath
from fractions import Fraction

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from strapgen.analysis.vibration.waves import Wave, resolvent

CYCLE = (3, 0)
shifts = st.tuples(st.integers(-5, 5), st.integers(-2, 2))
coefficients = st.fractions(-3, 3, max_denominator=4)
waves = st.builds(
    lambda terms: Wave(CYCLE, {}) + Wave(CYCLE, terms), st.dictionaries(shifts, coefficients, max_size=5)
)


def value(wave, angles=(0.37, 1.234)):
    z = cmath.exp(1j * CYCLE[0] * angles[0])
    total = 0
    for shift, c in wave.terms.items():
        total += float(c) * cmath.exp(1j * sum(a * s for a, s in zip(angles, shift, strict=True)))
    return total / (z - 1) ** wave.poles


@pytest.mark.long
@given(waves, waves, coefficients)
def test_waves_are_complex_numbers(left, right, factor):
    left, right = left.summed(), right.summed().summed()
    z = cmath.exp(1j * CYCLE[0] * 0.37)
    near = pytest.approx
    assert value(left + right) == near(value(left) + value(right), abs=1e-9)
    assert value(left * right) == near(value(left) * value(right), abs=1e-9)
    assert value(right.conjugate()) == near(value(right).conjugate(), abs=1e-9)
    assert value(left.scaled(factor)) == near(float(factor) * value(left), abs=1e-9)
    assert value(left.summed()) == near(value(left) / (z - 1), abs=1e-9)


@pytest.mark.long
@given(waves)
def test_what_is_a_difference_is_summed_without_poles(wave):
    difference = wave.shifted(CYCLE) + wave.scaled(-1)
    assert difference.summed() == wave
    assert difference.summed().poles == 0


@pytest.mark.parametrize(
    ("matrix", "zeros", "ones"),
    [
        ([[1, 0], [0, 1]], 0, 2),
        ([[1, 2], [0, 0]], 1, 1),
        ([[0, 1, 0], [0, 0, 1], [0, 0, 0]], 3, 0),
        ([[1, 0, 0], [3, 1, 0], [0, 2, 0]], 1, 2),
        ([["1/2", "1/2"], ["1/2", "1/2"]], 1, 1),
    ],
)
def test_the_resolvent_is_the_inverse(matrix, zeros, ones):
    exact = [[Fraction(x) for x in row] for row in matrix]
    powers, found_zeros, found_ones = resolvent(exact, Fraction(1))
    assert (found_zeros, found_ones) == (zeros, ones)
    z = sp.Symbol("z")
    size = len(matrix)
    adjugate = sum((z**k * sp.Matrix(power) for k, power in enumerate(powers)), sp.zeros(size, size))
    wanted = (z * sp.eye(size) - sp.Matrix(exact)).adjugate()
    assert (adjugate - wanted).applyfunc(sp.expand) == sp.zeros(size, size)


def test_other_eigenvalues_are_told():
    assert resolvent([[Fraction(1, 2)]], Fraction(1)) is None
    assert resolvent([[Fraction(0), Fraction(-1)], [Fraction(1), Fraction(0)]], Fraction(1)) is None
    # A 1 among them is divided out first.
    assert resolvent([[Fraction(1), Fraction(0)], [Fraction(5), Fraction(1, 2)]], Fraction(1)) is None
    assert resolvent([[Fraction(1), Fraction(0)], [Fraction(0), Fraction(2)]], Fraction(1)) is None
