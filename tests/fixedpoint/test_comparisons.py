"""Error bounds of maxima and selections: attained by integers of a few bits, where the other case is the worse one."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from small_integers import GRID, Known, at_corners, context, quantity, worst

from strapgen.fixedpoint.quantities import ExactOperation
from strapgen.fixedpoint.quantization import (
    lower_computed,
    lower_maximum,
    lower_nearest_integer,
    lower_selection,
)
from strapgen.ir.exceptions import InputError

FINE = Known(4, -7, 7, Fraction(1, 100))
COARSE = Known(2, -3, 3, Fraction(1, 9))
EXACT = Known(3, -2, 2)
ZERO = Fraction(0)


def lowered(lower, known, definition, low, high, **settings):
    item = quantity("y", definition, low, high)
    walk = context(known, item, **settings)
    lower(walk, item, definition)
    return walk.values["y"], walk


@pytest.mark.parametrize(
    ("known", "arguments", "exact"),
    [
        ({"a": FINE, "b": COARSE}, ("a", "b"), max),
        ({"b": COARSE, "a": FINE}, ("b", "a"), max),
        ({"a": EXACT}, ("a", Fraction(1, 3)), lambda a: max(a, Fraction(1, 3))),
        ({"a": COARSE}, ("a", Fraction(-1, 3)), lambda a: max(a, Fraction(-1, 3))),
    ],
)
def test_a_maximum_is_off_by_the_largest_error_of_its_arguments(known, arguments, exact):
    value, walk = lowered(
        lower_maximum, known, ExactOperation("maximum", arguments), *at_corners(known, exact)
    )
    measured = worst(walk, "y", known, exact)
    assert measured.error <= value.error <= measured.error + GRID
    assert value.low <= measured.low
    assert value.high - 1 <= measured.high <= value.high
    assert value.peak == value.magnitude


def chosen(c, first, second):
    return first if c >= 0 else second


@pytest.mark.parametrize("names", [("a", "b"), ("b", "a")])
def test_a_selection_by_exact_numbers_is_off_by_the_error_of_the_worse_case(names):
    known = {"c": EXACT, "a": FINE, "b": COARSE}
    value, walk = lowered(lower_selection, known, ExactOperation("select", ("c", ZERO, *names)), -1, 1)
    measured = worst(walk, "y", known, lambda c, a, b: chosen(c, *({"a": a, "b": b}[name] for name in names)))
    assert measured.error <= value.error <= measured.error + GRID
    assert value.error == COARSE.error or value.error - COARSE.error < GRID


@pytest.mark.parametrize("case", [("c", ZERO, "a"), (ZERO, "c", "a")])
def test_a_selection_by_an_inexact_number_is_off_by_all_of_its_range_too(case):
    known = {"c": Known(3, -2, 2, Fraction(1, 50))}
    known |= {"a": Known(3, -4, 4, Fraction(1, 9)), "b": Known(2, -2, 2, Fraction(1, 9))}
    most = Fraction(1, 2) - Fraction(1, 9)
    value, walk = lowered(lower_selection, known, ExactOperation("select", (*case, "b")), -most, most)
    sign = 1 if case[0] == "c" else -1
    measured = worst(walk, "y", known, lambda c, a, b: a if sign * c >= 0 else b)
    # Where c is computed as 0, the exact one may be at one end of b, and the computed one at the other end of a.
    assert measured.error == 2 * most + Fraction(1, 9) <= value.error <= measured.error + GRID


def test_outcomes_without_room_at_one_fraction_lose_a_unit_of_it():
    known = {"c": EXACT, "a": Known(18, -20, 20), "b": Known(0, 90, 100)}
    value, walk = lowered(lower_selection, known, ExactOperation("select", ("c", ZERO, "a", "b")), -100, 100)
    measured = worst(walk, "y", known, chosen)
    unit = Fraction(2) ** -value.fraction
    assert value.fraction < 18
    assert measured.error <= value.error == unit
    assert measured.error >= unit - Fraction(1, 1 << 17)  # all but the last bit of 18


def test_numbers_that_have_no_room_beside_each_other_cannot_be_compared():
    known = {"a": Known(18, -40, 40), "b": Known(0, -100, 100)}
    with pytest.raises(InputError, match="too short to compare"):
        lowered(lower_maximum, known, ExactOperation("maximum", ("a", "b")), -100, 100)


@pytest.mark.parametrize(
    ("low", "high"),
    [(-2, 2), (-2, Fraction(1, 5)), (Fraction(-1, 5), 2), (Fraction(-3, 8), Fraction(3, 8)), (0, 0)],
)
def test_a_computed_value_is_kept_in_the_range_of_the_exact_one(low, high):
    known = {"a": FINE}
    value, walk = lowered(lower_computed, known, ExactOperation("computed", ("a",)), low, high)
    measured = worst(walk, "y", {"a": Known(4, -7, 7)}, lambda a: min(max(a, low), high))
    # It is a number that what comes after takes as exact; brought into the range it moves by less than a unit.
    assert value.error == 0
    assert measured.error < Fraction(1, 16)
    assert (value.low, value.high) == (measured.low, measured.high)
    assert value.low == max(-7, math.ceil(low * 16))
    assert value.high == min(7, math.floor(high * 16))


def test_a_range_without_a_word_is_too_short():
    with pytest.raises(InputError, match="too short for a"):
        lowered(
            lower_computed, {"a": FINE}, ExactOperation("computed", ("a",)), Fraction(1, 60), Fraction(1, 50)
        )


@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
@pytest.mark.parametrize("factor", [Fraction(5, 4), Fraction(-3, 8), Fraction(1)])
def test_the_nearest_integer_is_that_whatever_the_rounding_of_words(factor, rounding):
    known = {"a": Known(4, -100, 90)}

    def exact(a: Fraction) -> Fraction:
        return Fraction(math.floor(a * factor + Fraction(1, 2)))

    ends = at_corners(known, exact)
    value, walk = lowered(
        lower_nearest_integer, known, ExactOperation("nearest", ("a", factor)), *ends, rounding=rounding
    )
    measured = worst(walk, "y", known, exact)
    assert measured.error == value.error == 0
    assert (value.low, value.high) == (measured.low, measured.high)
    assert measured.peak <= value.peak == 100 * abs(factor.numerator) + (8 * factor.denominator)
    with pytest.raises(InputError, match="too short"):
        lowered(
            lower_nearest_integer, {"a": Known(-3, -3, 3)}, ExactOperation("nearest", ("a", factor)), -20, 20
        )
