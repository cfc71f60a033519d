"""Calls and runs in fixed point stay within the bounds of their headers, and balls notice those that do not."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from derived import program
from small_programs import node
from small_programs import program as small

from strapgen.catalogue import choose, choose_step
from strapgen.evidence import actual_errors
from strapgen.evidence.actual_errors import ball
from strapgen.evidence.collection import Subject
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.ir.fixed_settings import Settings

flint = pytest.importorskip("flint")

PRODUCT, EULER = Subject(choose("euler-product")), Subject(choose_step("euler", "rk4", 2))


@pytest.mark.parametrize(
    "name", ["euler-product", "euler-normalize", "euler-from-dcm", "dcm-from-euler-angles"]
)
def test_calls_stay_within_their_bound_and_come_near_it(name):
    accepted, share, radius = actual_errors.errors_of_calls(Subject(choose(name)), 300)
    assert accepted > 150
    assert 0.2 < share <= 1
    assert radius < 1e-60


def test_a_call_that_is_off_by_a_unit_is_noticed(monkeypatch):
    def off(*arguments):
        table = vectors_of_choice(*arguments)
        rows = [
            replace(row, outputs=tuple(tuple(word + 1 for word in words) for words in row.outputs))
            if row.status == 0
            else row
            for row in table.rows
        ]
        return replace(table, rows=tuple(rows))

    monkeypatch.setattr(actual_errors, "vectors_of_choice", off)
    monkeypatch.setattr(actual_errors, "COUNT", 100)
    assert actual_errors.check(PRODUCT, None)[0].result == "fails"


def test_balls_that_are_too_wide_prove_nothing(monkeypatch):
    monkeypatch.setattr(actual_errors, "COUNT", 100)
    monkeypatch.setattr(actual_errors, "PRECISION", 30)
    verdict = actual_errors.check(PRODUCT, None)[0]
    assert (verdict.result, verdict.detail) == ("fails", "balls become too wide")


@pytest.mark.parametrize(
    ("step", "settings"),
    [
        (("euler", "rk4"), {}),
        (("dcm", "rk4"), {}),
        (("euler", "rk2"), {}),
        (("euler", "rk4"), {"carry": "full"}),
        (("euler", "rk4"), {"multiply": "high"}),
    ],
    ids=str,
)
def test_runs_stay_within_their_bound(step, settings):
    subject = Subject(choose_step(*step, 2), Settings(**settings))
    angles = subject.fixed.interface.angle_accumulation
    run = actual_errors.random_run_angle(subject, angles, 400)
    assert run.proper
    assert 0 < run.angle <= run.bound
    if step == ("dcm", "rk4"):
        assert run.normalizations == 400 // angles.proved_steps


def test_a_run_that_drifts_is_noticed(monkeypatch):
    angles = EULER.fixed.interface.angle_accumulation
    model, normalization = actual_errors._models(EULER)

    def drifting(words, *others):
        return ((results := model(words, *others))[0][0] + 40, *results[0][1:]), *results[1:]

    monkeypatch.setattr(actual_errors, "_models", lambda _: (drifting, normalization))
    run = actual_errors.random_run_angle(EULER, angles, 200)
    assert run.angle > run.bound


def test_a_step_whose_bound_of_a_run_has_no_end_is_not_examined(monkeypatch):
    monkeypatch.setattr(actual_errors, "COUNT", 50)
    verdicts = actual_errors.check(Subject(choose_step("euler", "rk1", 2)), None)
    assert [verdict.result for verdict in verdicts] == ["agrees", "not examined"]
    assert [verdict.claim for verdict in verdicts] == ["error bound: 50 calls", "error bound: 50 steps"]


def _balls(values):
    return [ball(Fraction(float(x))) for x in np.ravel(values)]


def test_the_angle_between_attitudes_is_that_of_a_rotation():
    quaternion = np.array([0.0, 0.0, np.sin(0.05), np.cos(0.05)])
    assert actual_errors.angle_between(_balls([0, 0, 0, 1]), _balls(-3 * quaternion)) == pytest.approx(
        0.1, rel=1e-14
    )
    turn = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])
    stretched = turn @ np.array([[1.05, 0.01, 0], [0.01, 0.97, 0.02], [0, 0.02, 1]])
    assert actual_errors.angle_between(_balls(np.eye(3)), _balls(stretched)) == pytest.approx(0.1, rel=1e-13)
    with flint.ctx.workprec(200):
        tiny = [ball(Fraction(0)), ball(Fraction(1, 10**20)), ball(Fraction(0)), ball(Fraction(1))]
    assert actual_errors.angle_between(_balls([0, 0, 0, 1]), tiny) == pytest.approx(2e-20, rel=1e-9)


def test_a_ball_holds_a_third():
    assert actual_errors.ball(Fraction(1, 3)).contains(flint.fmpq(1, 3))


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
    (near,) = actual_errors.evaluate_single(code, [actual_errors.column_of([x]) for x in arguments])
    assert float(near[0]) == pytest.approx(float(exact), abs=1e-14)


def test_a_comparison_that_a_ball_leaves_open_holds_both_values():
    code = small({"y": node("select", node("at_least", "x", 0), 1, 5)}, {"x": 1})
    (unsure,) = actual_errors.evaluate_single(code, [flint.arb(0, 1)])
    assert unsure.contains(flint.arb(1))
    assert unsure.contains(flint.arb(5))
    assert actual_errors.evaluate_single(code, [flint.arb(-1)]) == [5]


def test_products_in_pairs_are_products_in_order():
    product = program(choose("euler-product"))
    turns = [[math.sin(k + row) for k in range(7)] for row in range(4)]
    columns = [np.array([flint.arb(x) for x in row], object) for row in turns]
    expected = [column[0] for column in columns]
    for k in range(1, 7):
        expected = actual_errors.evaluate_single(product, [*expected, *(column[k] for column in columns)])
    pairs = zip(actual_errors.product_in_pairs(product, columns), expected, strict=True)
    assert all(near.overlaps(other) and near.rad() < 1e-10 for near, other in pairs)
