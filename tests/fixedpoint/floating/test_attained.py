"""Terms of rounding bounds that hide behind larger ones: errors are large here, and functions err by all they may."""

from __future__ import annotations

import itertools
from fractions import Fraction

import pytest
from small_programs import EXACT, node, program

from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.fixedpoint.floating.errors import (
    NUMBERS,
    Expression,
    Expressions,
    NumberFormat,
    _ComputedNumber,
    _ComputedNumbers,
    _root_share,
    exponent,
)
from strapgen.fixedpoint.intervals import Interval, root
from strapgen.ir.program import Operation, Program

FLOAT = NUMBERS["float"]


def off(exact: Fraction, near: Fraction) -> Operation:
    """Return a number that float computes as another one, less than 1 away: a difference of two literals.

    Around 3 * 2^22 float has whole numbers alone. Each literal lies almost half a unit beside one.
    """
    unit = Fraction(2) ** -(near.denominator.bit_length() - 1)
    half = (near - exact) / unit / 2
    literals = (3 * 2**22 + near / unit - half, 3 * 2**22 + half)
    return node("multiply", unit, node("subtract", *literals))


THREE_QUARTERS = off(Fraction(3, 4), Fraction(1))
#: Nearly 0, computed as 1/16 or as 1/4.
SIXTEENTH, QUARTER = (off(near / 2**20, near) for near in (Fraction(1, 16), Fraction(1, 4)))
#: Computed as what is smaller or larger than exact.
SMALLER, LARGER = off(Fraction(5, 4), Fraction(1)), off(Fraction(7, 4), Fraction(2))
FAR_BELOW = node("multiply", node("subtract", "a", LARGER), THREE_QUARTERS)
POSITIVE, NEGATIVE = node("at_least", "a", 0), node("at_least", 0, "a")


def squared(name: str) -> Operation:
    return node("multiply", name, name)


def measured(code: Program, *rows: dict[str, Fraction]) -> Fraction:
    """Return the largest error of a program in float whose functions take the farther of two numbers."""
    return max(
        abs(code.run(row, FLOAT.rounded, FARTHER)["out"][0] - code.run(row, operations=EXACT)["out"][0])
        for row in rows
    )


def bound(code: Program) -> Fraction:
    (error,) = rounding_bounds(code, "float").errors["out"]
    return error


def farther(value: Fraction) -> Fraction:
    """Return the number beside a value that is within one unit in the last place, but not the nearest."""
    unit = Fraction(2) ** max(exponent(abs(value)) - 23, -149)
    below = value // unit * unit
    return below if value - below > unit / 2 else below + unit


def sine(x: Fraction) -> Fraction:
    return farther(EXACT["sin"](x))


#: Operations that round to the nearest number, but for functions, which may be off by a unit in the last place.
FARTHER = EXACT | {
    kind: lambda *a, exact=EXACT[kind]: FLOAT.rounded(exact(*a))
    for kind in ("add", "subtract", "multiply", "divide", "sqrt")
}
FARTHER |= {
    "sin": sine,
    "cos": lambda x: farther(EXACT["cos"](x)),
    "sinc": lambda x: FLOAT.rounded(sine(x) / x),
}


@pytest.mark.parametrize(
    ("body", "share"),
    [
        pytest.param(body, share, id=name)
        for name, share, body in [
            ("product", 1, {"y": node("multiply", THREE_QUARTERS, node("add", THREE_QUARTERS, 1))}),
            ("square of a product", 1, {"x": FAR_BELOW, "y": squared("x")}),
            ("quotient", 1, {"y": node("divide", LARGER, SMALLER)}),
            ("square of a quotient", 1, {"x": node("divide", LARGER, SMALLER), "y": squared("x")}),
            ("root", 1, {"y": node("sqrt", SMALLER)}),
            ("inverse root", 1, {"x": node("sqrt", SMALLER), "y": node("divide", 1, "x")}),
            ("cosine", 0.99, {"y": node("cos", SIXTEENTH)}),
            ("cosine away from 0", 0.95, {"y": node("cos", off(Fraction(7, 16), Fraction(1, 2)))}),
            ("inverse sinc", 0.96, {"x": node("sinc", QUARTER), "y": node("divide", 1, "x")}),
            ("sinc away from 0", 0.98, {"y": node("sinc", off(Fraction(3, 8), Fraction(1, 2)))}),
            ("steepest sinc", 0.85, {"y": node("sinc", off(Fraction(33, 16), Fraction(17, 8)))}),
            ("maximum", 1, {"x": node("maximum", THREE_QUARTERS, "a"), "y": squared("x")}),
            ("maximum of", 1, {"x": node("maximum", "a", THREE_QUARTERS), "y": squared("x")}),
            ("selection", 1, {"x": node("select", POSITIVE, "a", THREE_QUARTERS), "y": squared("x")}),
            ("selected", 1, {"x": node("select", NEGATIVE, THREE_QUARTERS, "a"), "y": squared("x")}),
        ]
    ],
)
def test_what_a_large_error_does_is_the_bound(body, share):
    code = program(body, {"a": Fraction(1, 2)})
    error = measured(code, {"a": Fraction(-1, 2)})
    assert share * bound(code) * (1 - Fraction(1, 10**5)) < error <= bound(code)


TINY = Fraction(1, 1 << 140)
#: A unit in the last place of numbers from 2 to 4.
UNIT = Fraction(1, 1 << 22)
#: What is added to 3 with an error of nearly half a unit upward, and downward.
UPWARD, DOWNWARD = UNIT / 2 * Fraction(1025, 1024), UNIT / 2 * Fraction(1023, 1024)
NEARLY_FOUR = {"a": 4 - UNIT, "b": UNIT * Fraction(9, 16), "c": UNIT * Fraction(9, 8)}
SHIFTED = {"c": node("add", "a", 3), "d": node("add", "b", 3)}


@pytest.mark.parametrize(
    ("body", "limits", "rows", "share"),
    [
        # Near pi/6 the sine is just above 1/2: its unit in the last place is largest beside it, and beside sin(x)/x.
        ({"y": node("sinc", "a")}, {"a": 1}, [{"a": Fraction(k, 997)} for k in range(523, 560)], 0.7),
        (
            {"y": node("sin", "a")},
            {"a": Fraction(3, 4)},
            [{"a": Fraction(k, 64)} for k in range(40, 49)],
            0.9,
        ),
        ({"y": node("cos", "a")}, {"a": 1}, [{"a": Fraction(k, 64)} for k in range(4, 65)], 0.9),
        # The smallest numbers are as far apart as they are large.
        ({"y": node("sin", "a")}, {"a": TINY}, [{"a": TINY}], 0.99),
        ({"y": node("sin", "a")}, {"a": TINY * 3 / 2}, [{"a": TINY * 3 / 2}], 0.99),
        ({"y": node("multiply", Fraction(1, 2), "a")}, {"a": 1}, [{"a": Fraction(1, 1 << 149)}], 0.99),
        ({"y": node("multiply", "a", "a")}, {"a": Fraction(1, 1 << 75)}, [{"a": Fraction(1, 1 << 75)}], 0.99),
        # The root of an underflow is far larger than it.
        (
            {"x": squared("a"), "y": node("sqrt", "x")},
            {"a": Fraction(1, 1 << 76)},
            [{"a": Fraction(1, 1 << 76)}],
            0.49,
        ),
        # The smallest odd number of 25 bits.
        ({"y": node("add", 2**24 - 1, 2)}, {"a": 1}, [{"a": Fraction(0)}], 0.99),
        # Both summands lose half a unit of theirs, and their sum, an odd number of those, one of its own.
        (
            SHIFTED | {"y": node("add", "c", "d")},
            {"a": 1, "b": 1},
            [{"a": UPWARD, "b": UPWARD + k * UNIT} for k in range(4)],
            0.99,
        ),
        (
            SHIFTED | {"x": node("subtract", "c", "d"), "y": node("add", "x", 4)},
            {"a": 1, "b": 1},
            [{"a": UPWARD + k * UNIT, "b": DOWNWARD} for k in range(4)],
            0.99,
        ),
        # The first sum is rounded to 4, and only so the second comes near the middle between two numbers.
        (
            {"x": node("add", "a", "b"), "y": node("add", "x", "c")},
            NEARLY_FOUR,
            [NEARLY_FOUR],
            0.87,
        ),
    ],
)
def test_a_rounding_at_its_worst_is_the_bound(body, limits, rows, share):
    code = program(body, limits)
    rows = [{name: FLOAT.rounded(value) for name, value in row.items()} for row in rows]
    assert share * bound(code) < measured(code, *rows) <= bound(code)


@pytest.mark.parametrize(
    "difference",
    [
        node("subtract", off(Fraction(1, 4), Fraction(0)), Fraction(1, 8)),
        node("add", off(Fraction(-1, 4), Fraction(0)), Fraction(1, 8)),
        node("subtract", off(Fraction(1, 4), Fraction(0)), Fraction(1, 4)),
    ],
)
def test_a_comparison_that_turns_is_seen(difference):
    code = program({"y": node("select", node("at_least", difference, 0), 1, -1)}, {"a": 1})
    assert measured(code, {"a": Fraction(0)}) == 2
    assert rounding_bounds(code, "float").reason == "rounding may turn a comparison in y"


# Errors relative to the exact value


COARSE = NumberFormat(4, -6, 10)
#: A share of the exact value and what is beside it, for two operands that are not negative.
PAIRS = ((Fraction(1, 9), Fraction(1, 70)), (Fraction(1, 5), Fraction(1, 90)))
LARGEST = (Fraction(3), Fraction(2))


def relative(kind: str, ranges: list[Interval], rounding: Fraction) -> tuple[Fraction, Fraction] | None:
    """Return the relative bound of an operation on two operands."""
    expression = Expression(kind, (0, 1))
    numbers = _ComputedNumbers(Expressions(), ranges, COARSE)
    for (share, rest), largest, known in zip(PAIRS, LARGEST, ranges, strict=True):
        numbers.items.append(
            _ComputedNumber(known, share * largest + rest, Fraction(0), relative=(share, rest))
        )
    return numbers._relative(2, expression, rounding)


@pytest.mark.parametrize("rounding", [Fraction(0), Fraction(1, 8)])
@pytest.mark.parametrize("kind", ["add", "multiply"])
def test_the_relative_bound_is_attained_where_operands_are_as_far_off_as_they_may(kind, rounding):
    told = relative(kind, [Interval.of(0, largest) for largest in LARGEST], rounding)
    assert told is not None
    share, rest = told
    slack = []
    for exact in itertools.product(*((0, largest) for largest in LARGEST)):
        near = [value * (1 + a) + b for value, (a, b) in zip(exact, PAIRS, strict=True)]
        value, computed = EXACT[kind](*exact), EXACT[kind](*near)
        if rounding:
            computed += computed * COARSE.unit + COARSE.underflow
        slack.append(share * value + rest - (computed - value))
    # A product has twice the product of both rests to spare.
    spare = 2 * PAIRS[0][1] * PAIRS[1][1] * (1 + COARSE.unit) if kind == "multiply" else Fraction(0)
    assert 0 <= min(slack) <= spare + Fraction(1, 10**30)


def test_a_difference_has_no_relative_bound():
    assert relative("subtract", [Interval.of(0, 3), Interval.of(0, 2)], Fraction(0)) is None
    assert relative("add", [Interval.of(0, 3), Interval.of(-2, 2)], Fraction(0)) is None


def test_the_relative_error_of_a_literal_is_all_of_it():
    numbers = _ComputedNumbers(Expressions(), [], COARSE)
    for value in (Fraction(1, 3), Fraction(17, 16), Fraction(25, 7)):
        share, rest = numbers._literal(value).relative
        assert abs(COARSE.rounded(value) - value) == pytest.approx(share * value, rel=1e-30)
        assert not rest


@pytest.mark.parametrize("share", [Fraction(k, 16) for k in range(17)])
def test_a_root_is_off_by_no_larger_share_than_its_bound(share):
    """The largest change of a root is that of a smaller radicand: 1 - root(1 - share)."""
    assert (1 - _root_share(share)) ** 2 <= 1 - share
    assert _root_share(share) <= Fraction(5, 4) * (1 - root(1 - share)) if share <= Fraction(1, 4) else True
    assert root(share) ** 2 >= share
