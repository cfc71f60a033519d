"""Ranges in exact arithmetic hold all values, and are not far wider."""

from __future__ import annotations

import itertools
from fractions import Fraction

import pytest
from derived import programs
from small_programs import EXACT, node, program

from strapgen.fixedpoint.floating.errors import Expressions
from strapgen.fixedpoint.floating.exact_ranges import ExactRanges
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.program import DOUBLE_RESOLUTION, RESOLUTION, Program


def ranges(code: Program) -> ExactRanges:
    box = {s.name: Interval.symmetric(s.bound) for s in code.inputs if s.bound is not None}
    return ExactRanges(code, Expressions.of(code), box)


@pytest.mark.parametrize(
    ("value", "limits", "spare"),
    [
        # The range of cosine is that of its first two terms.
        (node("cos", "a"), {"a": Fraction(1)}, Fraction(1, 24)),
        (node("sinc", "a"), {"a": Fraction(1)}, Fraction(1, 120)),
        (node("cos", "a"), {"a": Fraction(4)}, Fraction(1, 1000)),
        (node("sinc", "a"), {"a": Fraction(5)}, Fraction(4, 5)),
        (node("sin", "a"), {"a": Fraction(1, 8)}, Fraction(1, 3000)),
        (node("select", node("at_least", "a", 0), "a", "b"), {"a": 1, "b": 2}, Fraction(0)),
        (node("select", node("at_least", "a", 0), "b", "a"), {"a": 1, "b": 2}, Fraction(0)),
        (node("maximum", "a", node("maximum", "b", -2)), {"a": 1, "b": 3}, Fraction(0)),
    ],
)
def test_a_range_holds_all_values_and_its_ends_are_near_some(value, limits, spare):
    code = program({"y": value}, limits)
    known = ranges(code).ranges[-1]
    grid = [[Fraction(k, 16) * limit for k in range(-16, 17)] for limit in limits.values()]
    values = [
        code.run(dict(zip(limits, point, strict=True)), operations=EXACT)["out"][0]
        for point in itertools.product(*grid)
    ]
    # 1/100: the grid does not meet the turning points of the functions.
    assert known.lowest <= min(values) <= known.lowest + spare + Fraction(1, 100)
    assert known.highest - Fraction(1, 100) - spare <= max(values) <= known.highest


def test_the_resolution_is_that_of_either_type():
    code = program({"y": node("multiply", RESOLUTION, "a")}, {"a": 1})
    proofs = ranges(code)
    place = proofs.expressions.names[RESOLUTION]
    known = proofs.ranges[place]
    assert (known.lowest, known.highest) == (DOUBLE_RESOLUTION, Fraction(1, 1 << 23))


def test_what_is_squared_is_limited_by_the_root_of_the_limit():
    code = programs()["euler-normalize"]
    expressions = Expressions.of(code)
    (state,) = code.inputs
    proofs = ExactRanges(code, expressions, dict.fromkeys(state.elements, Interval.symmetric(Fraction(2))))
    (condition,) = proofs.conditions
    for name in state.elements:
        known = proofs.ranges[expressions.names[name]]
        assert 0 <= known.highest**2 - condition.high < Fraction(1, 1 << 150)
        assert 0 <= known.lowest**2 - condition.high < Fraction(1, 1 << 150)
