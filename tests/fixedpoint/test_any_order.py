"""Bounds in any order of the operations: each part of them worked out by hand, and what has none."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from small_programs import node, program

from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.ir.program import Program

UNIT = Fraction(1, 1 << 24)
THIRD = Fraction(1, 3)
SMALL = Fraction(1, 1 << 65)


def bound(code: Program) -> Fraction:
    order = rounding_bounds(code, "float").any_order
    assert not order.without
    (error,) = order.errors["out"]
    return error


#: Programs, and the bound of each in half places of 1: N times M, and what is under a quotient or a root.
BY_HAND = {
    "sum": (program({"y": node("add", "a", "b")}, {"a": 1, "b": 2}), 3),
    "difference of a product": (
        program({"y": node("subtract", node("multiply", "a", "b"), "a")}, {"a": 1, "b": 2}),
        2 * 3,
    ),
    "literal": (program({"y": node("multiply", "a", THIRD)}, {"a": 3}), 2),
    "exact literal": (program({"y": node("multiply", "a", Fraction(1, 2))}, {"a": 2}), 1),
    # The divisor is 4 in magnitudes and 2 at least; its error is taken 4 times, as the quotient of 2 is twice.
    "quotient": (
        program({"d": node("add", "a", 3), "y": node("divide", "b", "d")}, {"a": 1, "b": 4}),
        6 * (2 + 4),
    ),
    "root": (
        program({"r": node("add", node("multiply", "a", "a"), 1), "y": node("sqrt", "r")}, {"a": 1}),
        7 * 3 * math.sqrt(2),
    ),
}


@pytest.mark.parametrize("name", BY_HAND)
def test_a_bound_is_that_worked_out_by_hand(name):
    code, units = BY_HAND[name]
    assert units * (1 - 1e-9) <= float(bound(code) / UNIT) <= units * (1 + 1e-5)


def test_what_is_flushed_is_multiplied_by_later_factors():
    """2**-65 times 2**-65 is below the normal numbers of a float; times 2**60 the error is 2**-70."""
    product = node("multiply", node("multiply", "a", "b"), "c")
    code = program({"y": product}, {"a": SMALL, "b": SMALL, "c": 1 << 60})
    assert SMALL * SMALL * (1 << 60) <= bound(code) <= Fraction(1, 1 << 60)


def test_a_copy_has_no_error():
    code = program({"y": node("add", "a", 1)}, {"a": 1}, result="a")
    assert bound(code) == 0


@pytest.mark.parametrize(
    ("value", "bounds", "without"),
    [
        (node("sin", "a"), {"a": 1}, "sines"),
        (node("cos", "a"), {"a": 1}, "cosines"),
        (node("sinc", "a"), {"a": 1}, "sin(x)/x"),
        (node("maximum", "a", "b"), {"a": 1, "b": 1}, "comparisons"),
        (node("sqrt", node("multiply", "a", "a")), {"a": 1}, "roots near zero"),
        (
            node("divide", "a", node("add", "a", 1 + Fraction(1, 1 << 23))),
            {"a": 1},
            "divisors near zero",
        ),
        (
            node("multiply", node("multiply", "a", "c"), "b"),
            {"a": 1 << 100, "b": 1 << 100, "c": Fraction(1, 1 << 100)},
            "products that may overflow",
        ),
    ],
)
def test_what_has_no_bound_is_named(value, bounds, without):
    known = rounding_bounds(program({"y": value}, bounds), "float")
    assert known.errors and known.any_order.without == without
