"""The rotation vector as a series in the rate: its exponential is the true rotation, and its forms are equal."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import factorial
from random import Random

import numpy as np
import pytest
from peano_baker import Series, generic_rate, lowest_difference, matrix, rotation

from strapgen.catalogue.methods import rotation_series
from strapgen.catalogue.methods.rotation_series import legendre_terms, terms
from strapgen.kernel.algebra import cross_elements, dot


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
