"""Balls hold exact values, of programs, products and rotations."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from derived import program
from small_programs import node
from small_programs import program as small

from strapgen.catalogue import choose
from strapgen.lab.certificate import balls

flint = pytest.importorskip("flint")


def test_the_rotation_of_a_stretched_matrix_is_that_of_the_nearest_rotation():
    turn = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
    stretched = turn @ np.array([[1.05, 0.01, 0], [0.01, 0.97, 0.02], [0, 0.02, 1]])
    with flint.ctx.workprec(128):
        x, y, z = balls.rotation_vector(flint.arb_mat(3, 3, stretched.ravel().tolist()))
    assert [float(value) for value in (x, y, z)] == pytest.approx([0, 0, 0.1], rel=1e-13, abs=1e-15)


def test_the_rotation_of_a_wide_matrix_holds_that_of_every_matrix_in_it():
    with flint.ctx.workprec(128):
        c, s = flint.arb(0.1).cos(), flint.arb(0.1).sin()
        turn = [x + flint.arb(0, 1e-6) for x in (c, -s, 0, s, c, 0, 0, 0, 1)]
        *_, z = balls.rotation_vector(flint.arb_mat(3, 3, turn))
        assert z.contains(0.1 + 0.9e-6)
        assert z.contains(0.1 - 0.9e-6)


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
    (near,) = balls.evaluate_single(code, [balls.column_of([x]) for x in arguments])
    assert float(near[0]) == pytest.approx(float(exact), abs=1e-14)


def test_a_comparison_that_a_ball_leaves_open_holds_both_values():
    code = small({"y": node("select", node("at_least", "x", 0), 1, 5)}, {"x": 1})
    (unsure,) = balls.evaluate_single(code, [flint.arb(0, 1)])
    assert unsure.contains(flint.arb(1))
    assert unsure.contains(flint.arb(5))
    assert balls.evaluate_single(code, [flint.arb(-1)]) == [5]


def test_products_in_pairs_are_products_in_order():
    product = program(choose("euler-product"))
    turns = [[math.sin(k + row) for k in range(7)] for row in range(4)]
    columns = [np.array([flint.arb(x) for x in row], object) for row in turns]
    expected = [column[0] for column in columns]
    for k in range(1, 7):
        expected = balls.evaluate_single(product, [*expected, *(column[k] for column in columns)])
    found = [element[0] for element in balls.product_in_pairs(product, [column[None] for column in columns])]
    pairs = zip(found, expected, strict=True)
    assert all(near.overlaps(other) and near.rad() < 1e-10 for near, other in pairs)
