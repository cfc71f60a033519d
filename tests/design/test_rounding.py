"""Rounding of taps: conditions hold exactly, and taps in words have the least error that the search reaches."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest

from strapgen.catalogue.methods import windows
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.filters import responses
from strapgen.design.filters.filter_taps import Shape, Unknowns, in_words, rounded
from strapgen.ir.exceptions import InputError

GYRO = GyroResponse(Fraction(40), Fraction(7071, 10000), Fraction(100))


def test_rationals_at_thirty_digits_are_those_that_are_known():
    taps = rounded(Unknowns(Shape(3, 3, 4), 1), WINDOWS["window-3-3"].filters[1], 30)
    known = ["3292544549/8053063680", "-200490913/2013265920", "7214415/536870912"]
    assert list(taps[4:]) == [Fraction(text) for text in known]
    assert list(taps[:4]) == [*(-Fraction(text) for text in reversed(known)), 0]


@pytest.mark.parametrize(
    "shape", [Shape(5, 5, 4), Shape(4, 2, 5), Shape(3, 3, 3, GYRO)], ids=["symmetric", "one", "gyro"]
)
def test_conditions_hold_exactly_whatever_is_rounded(shape, rng):
    for m in range(4):
        unknowns = Unknowns(shape, m)
        taps = rounded(unknowns, list(rng.normal(size=shape.samples)), 12)
        for row, right in zip(unknowns.rows, unknowns.right, strict=True):
            total = sum(c * x for c, x in zip(row, unknowns.values(taps), strict=True))
            assert total == right
        assert all((tap * 2**12).denominator == 1 for tap in unknowns.values(taps)[unknowns.inner :])


@pytest.mark.long
@pytest.mark.parametrize(("name", "bits"), [("window-3-3", 15), ("window-5-5", 24), ("window-4-2", 24)])
def test_words_hold_the_sum_and_the_first_moment_exactly(name, bits):
    window = WINDOWS[name]
    words = in_words(window, bits)
    windows.verify(words)
    assert words.conditions == 2 and words.parity == window.parity
    unit = Fraction(1, 2**bits)
    for m, (row, exact) in enumerate(zip(words.filters, window.filters, strict=True)):
        assert all((tap / unit).denominator == 1 for tap in row)
        # A free tap moves by a unit and a half; the inner ones answer by the polynomial through them.
        assert max(abs(a - b) for a, b in zip(row, exact, strict=True)) < 100 * unit, m


@pytest.mark.long
def test_no_other_word_of_a_free_tap_has_a_smaller_error():
    # F_1 with sum j F_j = 1/4 exactly, and the second tap nearest to sum j^3 F_j = 3/80 - 1/16, both by hand.
    window, bits = WINDOWS["window-5-5"], 20
    unit = Fraction(1, 2**bits)
    cubic = sum(j**3 * tap for j, tap in enumerate(window.filters[1][6:], 1))
    free = [round(tap / unit) for tap in window.filters[1][8:]]
    levels = {}
    for move in product((-1, 0, 1), repeat=3):
        outer = [(a + b) * unit for a, b in zip(free, move, strict=True)]
        rest = [sum(j**power * tap for j, tap in enumerate(outer, 3)) for power in (1, 3)]
        # x_1 + 2 x_2 = 1/4 - rest, x_1 + 8 x_2 = cubic - rest.
        second = round(((cubic - rest[1]) - (Fraction(1, 4) - rest[0])) / 6 / unit) * unit
        half = (Fraction(1, 4) - rest[0] - 2 * second, second, *outer)
        row = (*(-tap for tap in reversed(half)), Fraction(0), *half)
        levels[row] = responses.level(replace(window, filters=(window.filters[0], row)), 1)
    chosen = in_words(window, bits).filters[1]
    # The search has fewer frequencies: between them an error rises by less than 1 part in 1000.
    assert levels[chosen] <= 1.001 * min(levels.values()) < 0.9 * max(levels.values())


def test_words_need_a_symmetric_filter_for_equal_sides():
    window = WINDOWS["window-3-3"]
    row = (Fraction(1), *window.filters[1][1:])
    with pytest.raises(InputError, match="has no symmetry"):
        in_words(replace(window, filters=(window.filters[0], row)), 30)
    with pytest.raises(InputError, match="bits is 1; a whole number from 2 to 128 is needed"):
        in_words(window, 1)
