"""Calls and runs in fixed point stay within the bounds of their headers, and balls notice those that do not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from strapgen.catalogue import choose, choose_step
from strapgen.evidence import actual_errors
from strapgen.evidence.collection import Subject
from strapgen.firmware.vectors import vectors_of_choice
from strapgen.ir.fixed_settings import Settings

pytest.importorskip("flint")

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
