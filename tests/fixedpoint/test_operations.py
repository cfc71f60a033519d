"""Quotients, roots, maxima and angles as quantities: what is proved of their ranges, and what only a check ensures."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import pytest
from small_programs import node, program

from strapgen.fixedpoint import functions
from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import Quantity
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import Node, Program
from strapgen.ir.signals import Signal

UNIT_VECTOR = Signal("e", (4,), ("a", "b", "c", "d"), constraint="unit")


def derived(code: Program) -> dict[str, Quantity]:
    limits = {name: s.bound or Fraction(17, 16) for s in code.inputs for name in s.elements}
    return quantities(code, {name: Interval.symmetric(size) for name, size in limits.items()}).items


def ends(body: dict[str, Node], name: str = "y") -> tuple[Fraction, Fraction]:
    known = derived(program(body, {"a": 1, "b": 2}))[name].range
    return known.lowest, known.highest


def test_a_quotient_by_a_number_is_a_multiple():
    y = derived(program({"y": node("divide", "a", -4)}, {"a": 3}))["y"]
    assert dict(y.definition.terms) == {("a",): Fraction(-1, 4)}
    assert (y.range.lowest, y.range.highest) == (Fraction(-3, 4), Fraction(3, 4))


def test_the_root_of_a_number_lies_between_its_ends():
    root = derived(program({"r": node("sqrt", 2), "y": node("multiply", "r", "a")}, {"a": 1}))["r"]
    ((_, low),) = root.definition.terms
    assert low**2 < 2 <= (low + root.approximation_error) ** 2
    assert root.approximation_error < Fraction(1, 1 << 150)


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (node("maximum", "a", "b"), -1, 2),
        (node("maximum", "a", node("negate", "a")), 0, 1),
        (node("maximum", "a", node("subtract", 1, "a")), Fraction(1, 2), 2),
        (node("select", node("at_least", "a", 0), "a", node("multiply", 3, "b")), -6, 6),
        (node("select", node("at_least", "a", 0), node("multiply", 3, "b"), "a"), -6, 6),
        (node("divide", "b", node("add", "a", 3)), -1, 1),
        (node("sqrt", node("add", "a", Fraction(5, 4))), Fraction(1, 2), Fraction(3, 2)),
    ],
)
def test_a_range_is_attained(value, low, high):
    assert ends({"y": value}) == (low, high)


def test_a_divisor_below_zero_is_checked_to_stay_there():
    squares = [node("multiply", name, name) for name in "abcd"]
    divisor = node("negate", node("add", node("add", *squares[:2]), node("add", *squares[2:])))
    code = program({"s": divisor, "y": node("divide", "a", "s")}, dict.fromkeys("abcd", 1))
    s = derived(replace(code, inputs=(UNIT_VECTOR,)))["s"]
    # -1 on unit vectors; the check is that of half and twice of it.
    assert (s.range.lowest, s.range.highest, s.range_checked) == (-2, Fraction(-1, 2), True)


@pytest.mark.parametrize(("least", "range_checked"), [(Fraction(3, 10), False), (Fraction(1, 5), True)])
def test_a_limit_that_is_proved_within_a_factor_of_two_is_not_checked(least, range_checked):
    """Of about 1 on unit vectors half is the limit; a proof of 3/10 is near it, and one of 1/5 is not."""
    squares = [node("multiply", name, name) for name in "abcd"]
    total = node("add", node("add", *squares[:2]), node("add", *squares[2:]))
    divisor = node("add", node("multiply", Fraction(95, 100) - least, total), least)
    code = program({"s": divisor, "y": node("divide", "a", "s")}, dict.fromkeys("abcd", 1))
    assert derived(replace(code, inputs=(UNIT_VECTOR,)))["s"].range_checked is range_checked


def test_nothing_is_checked_where_proper_inputs_come_near_zero():
    near = node("subtract", "a", Fraction(1, 2))
    divisor = node("add", node("multiply", near, near), Fraction(1, 512))
    code = program({"d": divisor, "y": node("divide", "a", "d")}, {"a": 1})
    with pytest.raises(ValueError, match=r"a division by \[-0"):
        derived(code)


def test_a_root_of_what_may_be_negative_is_refused():
    code = program({"s": node("add", "a", "b"), "y": node("sqrt", "s")}, {"a": 1, "b": 1})
    with pytest.raises(InputError, match=r"s may be below 0, its range is .*; it has no square root"):
        derived(code)


def slope_distance(code: Program, monkeypatch) -> Fraction:
    """Return the inverse of the slope that is stated for the angle of a program."""
    told: list[Fraction] = []
    derive = functions.derive_function
    monkeypatch.setattr(
        functions, "derive_function", lambda *arguments: [told.append(arguments[-1]), derive(*arguments)]
    )
    derived(code)
    (distance,) = told
    return distance


def test_the_slope_of_an_angle_is_that_of_the_shortest_vectors(monkeypatch):
    body = {
        "y1": node("add", node("multiply", "a", "b"), 2),
        "x1": node("subtract", 3, node("multiply", "a", "b")),
        "y": node("atan2", "y1", "x1"),
    }
    distance = slope_distance(program(body, {"a": 1, "b": 1}), monkeypatch)
    # Components of at least 1 and 2. Opposite vectors are half a turn apart in angle, and 2 * root(5) in place.
    assert distance**2 <= 5 * Fraction(7, 11) ** 2
    assert 0.99 * 2 / math.pi * math.sqrt(5) < distance <= 2 / math.pi * math.sqrt(5)


def test_vectors_that_are_checked_are_near_each_other(monkeypatch):
    rest = node("maximum", 0, node("subtract", 1, node("multiply", "a", "a")))
    code = program({"y": node("atan2", "a", node("sqrt", rest))}, {"a": 1})
    distance, length = float(slope_distance(code, monkeypatch)), math.sqrt(1 / 2)
    # Of length 1 at first, root(1/2) at least in the check. Ends 3/4 of that apart are 2 asin(3/8) apart in angle.
    assert 0.88 * length < distance <= length * (3 / 4) / (2 * math.asin(3 / 8))
