"""Balls hold the exact values of programs."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from derived import program
from small_programs import node
from small_programs import program as small

from strapgen.catalogue import choose
from strapgen.evidence import balls

flint = pytest.importorskip("flint")


def test_a_ball_holds_a_third():
    assert balls.ball(Fraction(1, 3)).contains(flint.fmpq(1, 3))


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        *(
            ("sin", (2,)),
            ("cos", (2,)),
            ("atan2", (1, -2)),
            ("sqrt", (2,)),
            ("sqrt", (0,)),
            ("maximum", (1, 2)),
        ),
        *(("wrap", (4,)), ("wrap", (-4,)), ("wrap", (1,)), ("sinc", (1,)), ("sinc", (0,))),
    ],
)
def test_functions_of_balls_are_those_of_programs(kind, arguments):
    names = [f"x{k}" for k in range(len(arguments))]
    code = small({"y": node(kind, *names)}, dict.fromkeys(names, 9))
    exact = code.run({name: float(x) for name, x in zip(names, arguments, strict=True)})["out"][0]
    (near,) = balls.outcome(code, [balls.column_of([x]) for x in arguments])
    assert float(near[0]) == pytest.approx(float(exact), abs=1e-14)


def test_a_comparison_that_a_ball_leaves_open_holds_both_values():
    code = small({"y": node("select", node("at_least", "x", 0), 1, 5)}, {"x": 1})
    (unsure,) = balls.outcome(code, [flint.arb(0, 1)])
    assert unsure.contains(flint.arb(1))
    assert unsure.contains(flint.arb(5))
    assert balls.outcome(code, [flint.arb(-1)]) == [5]


def test_products_in_pairs_are_products_in_order():
    product = program(choose("euler-product"))
    turns = [[math.sin(k + row) for k in range(7)] for row in range(4)]
    columns = [np.array([flint.arb(x) for x in row], object) for row in turns]
    expected = [column[0] for column in columns]
    for k in range(1, 7):
        expected = balls.outcome(product, [*expected, *(column[k] for column in columns)])
    pairs = zip(balls.multiplied(product, columns), expected, strict=True)
    assert all(near.overlaps(other) and near.rad() < 1e-10 for near, other in pairs)
