"""Quotients, roots, comparisons and outputs as integers: each term of a bound is attained, or nearly."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest
from small_integers import GRID, Known, Worst, at_corners, context, quantity, worst
from small_programs import node, program

from strapgen import quantize
from strapgen.fixedpoint.format_plan import MOST_GUARD_BITS
from strapgen.fixedpoint.integer_sums import integer_value
from strapgen.fixedpoint.quantities import ExactOperation, Quantities, Sum
from strapgen.fixedpoint.quantization import (
    _errors,
    _is_worse,
    _output,
    lower_computed,
    lower_maximum,
    lower_nearest_integer,
    lower_quotient,
    lower_root,
    lower_selection,
)
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum, Term, Value
from strapgen.ir.signals import Signal

ZERO = Fraction(0)


def value(name, low, high, *uses, error=Fraction(1, 100), **more) -> Value:
    definition = IntegerSum(tuple(Term((use,), 1) for use in uses)) if uses else None
    return Value(name, definition, 4, False, low, high, ZERO, error, 99, **more)


def test_values_after_a_reset_have_only_their_ranges():
    reset, between, after = value("r", -9, 9), value("m", -7, 7, "r"), value("y", -20, 12, "m")
    other, saturated = value("z", -5, 5), replace(value("s", -5, 5), saturated=True)
    context = SimpleNamespace(resets={"r"}, body=[reset, between, after, other, saturated])
    signal = Signal("out", (3,), ("y", "z", "s"), bound=Fraction(3, 2))
    told = _errors(context, signal, [after, other, saturated])
    # The exact one is at 3/2 and the computed one at -20/16; what saturates may lack a unit, and more if it is inexact.
    assert told == (Fraction(3, 2) + Fraction(20, 16), Fraction(1, 100), Fraction(1, 16))
    assert _errors(context, signal, [replace(saturated, error=Fraction(1, 3))]) == (Fraction(1, 3),)


def test_an_output_has_the_range_of_all_of_its_elements_and_one_format():
    first, second = value("y", -20, 5), value("z", -3, 12)
    context = SimpleNamespace(
        resets=set(),
        body=[first, second],
        values={"y": first, "z": second},
        word=8,
        quantities=Quantities({}, {"out": ("y", Fraction(1), "z")}),
    )
    signal = Signal("out", (2,), ("o_1", "o_2"))
    argument = _output(context, signal)
    assert (argument.low, argument.high, argument.format.fraction) == (-20, 12, 4)
    context.values["z"] = replace(second, fraction=5)
    with pytest.raises(InputError, match="elements of out share one format"):
        _output(context, signal)


@pytest.mark.parametrize("bits", [1, MOST_GUARD_BITS, MOST_GUARD_BITS + 1])
def test_inputs_have_up_to_so_many_bits_less_that_their_sum_is_exact(bits):
    largest = {"a": Fraction(1, 2), "b": Fraction(1, 2) / 2**bits}
    code = program({"s": node("add", "a", "b"), "y": node("multiply", "s", "s")}, largest)
    b = quantize(code, Settings(16)).interface.inputs[1]
    # The sum, of 1/2 to 1, has 15 places; an input of up to 1/2 has as many, and a smaller one more.
    assert b.format.fraction == (15 if bits <= MOST_GUARD_BITS else 15 + bits)


@pytest.mark.parametrize(("percent", "worse"), [(100, False), (101, False), (102, True)])
def test_an_error_that_is_a_hundredth_larger_is_no_worse(percent, worse):
    def told(*errors) -> SimpleNamespace:
        outputs = (SimpleNamespace(errors=(ZERO,)), SimpleNamespace(errors=errors))
        return SimpleNamespace(interface=SimpleNamespace(outputs=outputs))

    one, other = (Fraction(1), Fraction(percent, 100)), (Fraction(2), Fraction(1))
    assert _is_worse(told(*one), told(*other)) is worse


@pytest.mark.parametrize("sign", [1, -1])
def test_checked_value_has_an_exact_value_in_range(sign):
    low, high = sorted((sign * Fraction(1, 3), sign * Fraction(9, 5)))
    error, followed, approximation_error, places = Fraction(1, 40), Fraction(1, 70), Fraction(1, 90), 5
    item = quantity(
        "y",
        Sum(((("a",), Fraction(1)),)),
        low,
        high,
        range_checked=True,
        approximation_error=approximation_error,
    )
    walk = context({"a": Known(5, -80, 80)}, item)
    value = integer_value(walk, item, IntegerSum((Term(("a",), 1),)), places, error, 80, followed=followed)
    off = error + followed + approximation_error
    assert value.range_checked

    def surely_inside(integer: int) -> bool:
        return low <= Fraction(integer, 32) - off and Fraction(integer, 32) + off <= high

    # All that surely are inside pass, and no other.
    passing = [integer for integer in range(-80, 81) if surely_inside(integer)]
    assert (value.low, value.high) == (passing[0], passing[-1])


def test_an_error_of_half_the_smaller_end_is_the_largest_that_a_check_allows():
    low, high = Fraction(1, 2), Fraction(2)
    item = quantity("y", Sum(((("a",), Fraction(1)),)), low, high, range_checked=True)
    walk = context({"a": Known(5, 0, 80)}, item)

    def value(error):
        return integer_value(walk, item, IntegerSum((Term(("a",), 1),)), 5, error, 80)

    assert (value(low / 2).low, value(low / 2).high) == (24, 56)
    with pytest.raises(InputError, match="too short for y, its error may be as large as itself"):
        value(low / 2 + Fraction(1, 1 << 100))


FINE = Known(4, -7, 7, Fraction(1, 100))
COARSE = Known(2, -3, 3, Fraction(1, 9))
EXACT = Known(3, -2, 2)


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


def test_root_of_a_long_number_loses_the_shifted_bits():
    """Of 15 bits, two are cut off: of r^2 + r + 3/4 the root is more than half a unit above r."""
    value, measured = root(Known(10, 1 << 14, (1 << 14) + 700, wide=True))
    half_unit = Fraction(1, 2 << value.fraction)
    assert half_unit < measured.error <= value.error
    assert value.error - half_unit <= 3 * (measured.error - half_unit)


def test_a_truncated_root_lacks_up_to_a_unit():
    value, measured = root(Known(4, 16, 100), rounding="truncation")
    assert measured.error <= value.error == Fraction(1, 1 << value.fraction)
    assert measured.error > Fraction(98, 100) * value.error


def test_root_of_number_negative_by_error_is_accepted():
    value, _ = root(Known(4, 0, 1))
    assert (value.low, value.magnitude) == (0, value.high)
