"""Error bounds of quotients and roots: each term is attained, or nearly, by integers of a few bits."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from small_integers import GRID, Known, Worst, at_corners, context, quantity, worst

from strapgen.fixedpoint.quantities import ExactOperation
from strapgen.fixedpoint.quantization import lower_quotient, lower_root
from strapgen.ir.exceptions import InputError
from strapgen.ir.integer_program import Value

ABOVE = Known(4, -15, 15, Fraction(1, 50))
BELOW = Known(4, 16, 24, Fraction(1, 90))


def quotient(known, definition, exact, **options) -> tuple[Value, Worst]:
    item = quantity("y", definition, *at_corners(known, exact))
    walk = context(known, item, **options)
    lower_quotient(walk, item, definition)
    return walk.values["y"], worst(walk, "y", known, exact)


@pytest.mark.parametrize(
    ("known", "numerator", "exact", "fraction"),
    [
        # 15/16 in eighths is 7 and a half: the largest quotient is at the smallest divisor, and is rounded up by half a
        # unit, where the computed numerator is too large and the computed divisor too small.
        ({"a": ABOVE, "b": BELOW}, "a", lambda a, b: a / b, 3),
        ({"a": ABOVE, "b": Known(4, 16, 24)}, "a", lambda a, b: a / b, 3),
        # By a divisor of 2 the errors count half, by one of a half twice.
        ({"a": ABOVE, "b": Known(3, 16, 24, Fraction(1, 90))}, "a", lambda a, b: a / b, 4),
        ({"a": ABOVE, "b": Known(5, 16, 24, Fraction(1, 90))}, "a", lambda a, b: a / b, 2),
        ({"a": Known(4, -15, 15), "b": BELOW}, "a", lambda a, b: a / b, 3),
        # Two thirds are 171/256, which is too large; a sixteenth of it in 2048ths of 16ths is 85 and a half.
        ({"b": BELOW}, Fraction(2, 3), lambda b: Fraction(2, 3) / b, 7),
        ({"b": Known(4, -24, -16, Fraction(1, 90))}, Fraction(2, 3), lambda b: Fraction(2, 3) / b, 7),
    ],
)
def test_the_bound_of_a_quotient_is_attained(known, numerator, exact, fraction):
    value, measured = quotient(
        known, ExactOperation("divide", (numerator, "b")), exact, forced={"y": fraction}
    )
    assert measured.error <= value.error <= measured.error + GRID
    assert value.low <= measured.low <= value.low + 2
    assert value.high - 2 <= measured.high <= value.high
    assert measured.peak == value.peak


def test_a_truncated_quotient_lacks_up_to_a_unit():
    known = {"a": Known(4, -15, 15), "b": Known(4, 16, 24)}
    value, measured = quotient(
        known,
        ExactOperation("divide", ("a", "b")),
        lambda a, b: a / b,
        forced={"y": 3},
        rounding="truncation",
    )
    assert value.error == Fraction(1, 8)
    assert measured.error == value.error * Fraction(20, 21)  # of 13 by 21, 20 are left


def test_a_quotient_is_as_fine_as_the_numerator_has_room():
    known = {"a": Known(4, 100, 120), "b": Known(4, 64, 80)}
    fine, _ = quotient(known, ExactOperation("divide", ("a", "b")), lambda a, b: a / b)
    # 120/64 takes 6 places of an 8-bit word; half the divisor is added to a numerator of 15 bits before the division.
    assert fine.fraction == 6
    assert fine.peak + 80 // 2 < 1 << 15
    wide = {"a": Known(4, 11_900, 12_000, wide=True), "b": Known(4, 100, 110)}
    coarse, measured = quotient(wide, ExactOperation("divide", ("a", "b")), lambda a, b: a / b)
    assert (coarse.fraction, coarse.peak) == (0, 12_000)
    assert measured.error <= coarse.error == Fraction(1, 2)
    with pytest.raises(InputError, match="too short for y"):
        quotient(wide, ExactOperation("divide", ("a", "b")), lambda a, b: a / b, forced={"y": 2})


def test_half_of_a_wide_divisor_has_room_beside_the_numerator():
    # One place more would make 20,000 of the numerator, to which half of 15,010 is added: both have 15 bits together.
    known = {"a": Known(4, 9_990, 10_000, wide=True), "b": Known(4, 15_000, 15_010, wide=True)}
    value, measured = quotient(known, ExactOperation("divide", ("a", "b")), lambda a, b: a / b)
    assert (value.fraction, value.peak, measured.peak) == (0, 10_000, 10_000)
    with pytest.raises(InputError, match="too short for y"):
        quotient(known, ExactOperation("divide", ("a", "b")), lambda a, b: a / b, forced={"y": 1})


def root_of(value: Fraction) -> Fraction:
    """Return a square root to 100 binary places."""
    return Fraction(math.isqrt(value.numerator * value.denominator << 200), value.denominator << 100)


def root(argument: Known, **settings) -> tuple[Value, Worst]:
    known = {"a": argument}
    item = quantity("y", ExactOperation("sqrt", ("a",)), *at_corners(known, root_of))
    walk = context(known, item, **settings)
    lower_root(walk, item, item.definition)
    return walk.values["y"], worst(walk, "y", known, root_of)


@pytest.mark.parametrize(
    ("argument", "slope", "slack"),
    [
        # From 1 the slope is 1/2, at half a unit below it is 0.7: the exact one is 1/(1 + root(1/2)) at most.
        (Known(4, 8, 40, Fraction(1, 2)), Fraction(70_711, 100_000), Fraction(9, 100)),
        (Known(5, 32, 100, Fraction(1, 64)), Fraction(1, 2), Fraction(1, 300)),
        (Known(4, 16, 100), Fraction(0), Fraction(1, 1500)),
    ],
)
def test_the_bound_of_a_root_away_from_zero_is_its_slope_times_the_error(argument, slope, slack):
    value, measured = root(argument)
    half_unit = Fraction(1, 2 << value.fraction)
    assert measured.error <= value.error <= measured.error + slack
    assert value.error == pytest.approx(slope * argument.error + half_unit, rel=1e-4)
    assert value.low <= measured.low <= measured.high <= value.high
    assert measured.peak == value.peak
    # Half of what the error does would be exceeded, and so would the bound without the rounding.
    assert measured.error > value.error - max(slope * argument.error / 2, half_unit)


def test_the_root_of_an_error_is_the_bound_at_zero():
    argument = Known(4, 0, 100, Fraction(1, 9))
    value, measured = root(argument)
    half_unit = Fraction(1, 2 << value.fraction)
    # An exact 1/9 may be computed as 0, whose root is exact: it is off by a third, and elsewhere rounding comes to it.
    assert Fraction(1, 3) <= measured.error <= value.error == pytest.approx(Fraction(1, 3) + half_unit)


def test_a_root_of_a_long_number_loses_what_is_shifted_out():
    """Of 15 bits, two are cut off: of r^2 + r + 3/4 the root is more than half a unit above r."""
    value, measured = root(Known(10, 1 << 14, (1 << 14) + 700, wide=True))
    half_unit = Fraction(1, 2 << value.fraction)
    assert half_unit < measured.error <= value.error
    assert value.error - half_unit <= 3 * (measured.error - half_unit)


def test_a_truncated_root_lacks_up_to_a_unit():
    value, measured = root(Known(4, 16, 100), rounding="truncation")
    assert measured.error <= value.error == Fraction(1, 1 << value.fraction)
    assert measured.error > Fraction(98, 100) * value.error


def test_a_root_of_what_may_be_below_zero_by_its_error_is_refused_nowhere():
    value, _ = root(Known(4, 0, 1))
    assert (value.low, value.magnitude) == (0, value.high)
