"""Products of oscillations that have a mean, and the ring of polynomials in them."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from strapgen.analysis.vibration.rectification import DEGREE, Oscillations, resonances
from strapgen.kernel.power_series import Powers


def searched(shares):
    """Return the resonances by trying all products."""
    periods = [sign * share for share in shares for sign in (1, -1)]
    return [
        product
        for degree in range(1, 5)
        for product in itertools.combinations_with_replacement(range(len(periods)), degree)
        if sum(periods[k] for k in product).denominator == 1
    ]


@pytest.mark.parametrize(
    "shares",
    [
        ["0.1"],
        ["0.027", "0.054", "0.108"],
        ["0.027", "0.0541", "0.108"],
        ["0.4", "0.6"],  # whole periods together
        ["1", "0.3"],  # whole periods alone
        ["0.25", "1/3"],
        ["0.1", "0.1", "0.3"],  # the same frequency twice, and three times it
    ],
)
def test_resonances_are_those_of_all_products(shares):
    exact = [Fraction(share) for share in shares]
    assert resonances(exact) == searched(exact)


def test_a_sum_that_is_nearly_zero_is_no_resonance():
    near = Fraction(54, 1000) + Fraction(1, 10**15)
    assert len(resonances([Fraction(27, 1000), Fraction(54, 1000)])) > len(
        resonances([Fraction(27, 1000), near])
    )


def test_products_that_divide_a_resonance_are_kept_and_no_others():
    ring = Oscillations([Fraction("0.1"), Fraction("0.23")])
    assert [len(products) for products in ring.products] == [1, 4, 10, 8, 3]
    assert (0, 0, 2) not in ring.places[3], "it divides no product of four with a mean"
    assert (0, 0, 1) in ring.places[3] and (0, 1, 2) in ring.places[3]


@pytest.mark.parametrize("seed", range(3))
def test_products_of_polynomials_are_those_of_symbols(seed):
    rng = np.random.default_rng(seed)
    ring = Oscillations([Fraction(1, 9), Fraction(2, 9)])
    symbols = sp.symbols("a:4")
    elements = []
    for _ in range(3):
        amplitudes = rng.integers(-3, 4, 2) + 1j * rng.integers(-3, 4, 2)
        halves = [half for c in amplitudes for half in (complex(c) / 2, complex(c).conjugate() / 2)]
        number = int(rng.integers(1, 4))
        element = Powers(ring, {0: ring(number), 1: ring.oscillating(amplitudes)}, DEGREE)
        elements.append(
            (element, number + sum(sp.nsimplify(h) * s for h, s in zip(halves, symbols, strict=True)))
        )
    (a, x), (b, y), (c, z) = elements
    found = (a * b + c) * a * c - b
    expected = sp.Poly(sp.expand((x * y + z) * x * z - y), *symbols)
    for degree in range(DEGREE + 1):
        for product, value in zip(ring.products[degree], found.parts[degree].values, strict=True):
            exponents = [product.count(k) for k in range(4)]
            assert abs(value - complex(expected.coeff_monomial(exponents))) < 1e-12, product


def test_functions_of_a_length_are_series_in_its_square():
    ring = Oscillations([Fraction(1, 9)])
    small = Powers(ring, {1: ring.oscillating([0.2 - 0.1j])}, DEGREE)
    unit = (1 + small * small).root()
    difference = unit * unit - 1 - small * small
    assert all(np.abs(part.values).max() < 1e-15 for part in difference.parts.values())
    assert ((1 + small).inverse() * (1 + small)).start.LC == 1
