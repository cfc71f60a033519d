"""Bounds of a run against a recursion written out, Joseph's form at any gain, and what filters refuse."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from commands import says

from strapgen.catalogue.toml_models import parse
from strapgen.ir.exceptions import InputError
from strapgen.navigation.kalman.error_bound import run_bound
from strapgen.navigation.kalman.kalman_file import KalmanFile, described
from strapgen.navigation.kalman.kalman_filter import KalmanFilter

#: A damped oscillator whose place is measured.
TEXT = """
name = "oscillator"
[parameters]
damping = 0.5
[[state]]
name = "place"
unit = "m"
derivative = "speed"
deviation = 1
range = 100
[[state]]
name = "speed"
unit = "m/s"
derivative = "-place - damping*speed + push"
deviation = 1
range = 100
[[measurement]]
name = "fix"
unit = "m"
expression = "place"
deviation = 0.1
range = 100
[noise.push]
density = 0.5
[schedule]
interval = 0.25
kind = "steady"
"""


def filter_of(kind: str = "steady", every: int = 1, initial: str = "0", interval: str = "0.25"):
    """Return the filter with another schedule."""
    text = TEXT.replace('"steady"', f'"{kind}"\nduration = 6').replace("0.1\n", f"0.1\nevery = {every}\n")
    text = text.replace("deviation = 1\n", f'deviation = 1\ninitial = "{initial}"\n')
    text = text.replace("interval = 0.25\nkind", f"interval = {interval}\nkind")
    return KalmanFilter(described(parse(KalmanFile, tomllib.loads(text, parse_float=Decimal)), "test"))


def only(part: str, interfaces):
    """Return interfaces in which one part of the error is left: that of the time update, update or the gains."""

    def left(interface, kept: bool):
        outputs = []
        for one in interface.outputs:
            errors = one.errors if kept else tuple(Fraction(0) for _ in one.errors)
            low, high = (one.low, one.high) if part == "gains" else (0, 0)
            outputs.append(replace(one, errors=errors, low=low, high=high))
        return replace(interface, outputs=tuple(outputs))

    return [left(one, part == ("update" if place else "time")) for place, one in enumerate(interfaces)]


def sums(model, interfaces, periods: int):
    """Return the largest sums over all calls before of |products of the matrices after it| times its error."""
    n, every = len(model.states), model.text.measurements[0].every
    formats = {one.signal.name: one for one in interfaces[0].inputs}
    start = [
        abs(formats[one.name].format.nearest(one.initial) * formats[one.name].unit - one.initial)
        for one in model.text.states
    ]
    Phi, h = np.array(model.transition, float), np.array(model.H, float)[0]
    added = [
        np.array([float(max(o.errors)) for o in one.outputs if o.signal.name.startswith("next_")])
        for one in interfaces
    ]
    innovation = interfaces[1].outputs[0]
    largest = float(max(-innovation.low, innovation.high) * innovation.unit)
    rows = model.solved.rows["fix"]
    products, worst = [(np.eye(n), np.array(start, float))], np.array(start, float)
    for step in range(1, periods * every + 1):
        calls = [(Phi, added[0])]
        if step % every == 0:
            row = rows[step // every - 1] if len(rows) > 1 else rows[0]
            rounding = np.zeros(n)
            for k, one in enumerate(one for one in interfaces[1].inputs if "gain_" in one.signal.name):
                rounding[k] = abs(one.format.nearest(row[k]) * one.unit - row[k])
            calls.append((np.eye(n) - np.outer(np.array(row, float), h), added[1] + rounding * largest))
        for matrix, more in calls:
            products = [(matrix @ product, error) for product, error in products]
            products.append((np.eye(n), more))
            worst = np.maximum(worst, sum(np.abs(product) @ error for product, error in products))
    return worst


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("part", ["start", "time", "update", "gains"])
def test_the_bound_of_a_schedule_is_the_sum_over_all_calls(part, every):
    model = filter_of("scheduled", every, "1/3" if part == "start" else "0")
    interfaces = only(part, model.on("c-fixed16").interfaces)
    expected = sums(model, interfaces, 24 // every)
    assert (expected > 0).all()
    found = np.array(list(run_bound(model, interfaces).errors.values()))
    assert (found >= expected * (1 - 1e-12)).all() and (found <= expected * (1 + 1e-9)).all()


@pytest.mark.parametrize(("part", "every", "above"), [
    ("start", 1, 50), ("time", 1, 1.5), ("update", 1, 1.25), ("start", 3, 50), ("time", 3, 1.5), ("update", 3, 1.5),
])  # fmt: skip
def test_the_bound_of_steady_gains_is_the_sum_over_all_calls(part, every, above):
    model = filter_of("steady", every, "1/3" if part == "start" else "0")
    interfaces = only(part, model.on("c-fixed16").interfaces)
    expected = sums(model, interfaces, 200 // every)
    assert (expected > 0).all()
    bound = run_bound(model, interfaces)
    found = np.array(list(bound.errors.values()))
    assert bound.steps is None
    assert (found >= expected * (1 - 1e-12)).all() and (found <= expected * above).all()


def test_errors_without_a_finite_bound_are_not_certified():
    model = filter_of("steady", 1000, interval="1")
    assert run_bound(model, model.on("c-fixed32").interfaces) is None
    assert model.solved.residual < Fraction(1, 10**30)


def test_a_steady_gain_that_is_not_proved_is_refused(monkeypatch):
    monkeypatch.setattr("strapgen.navigation.kalman.riccati._PROOF_DIGITS", (70,))
    with pytest.raises(InputError, match=r"measurement\[fix\]\.every is 999; .* not proved to 30 digits"):
        filter_of("steady", 999, interval="1")


def test_josephs_form_holds_at_any_gain():
    """P + is (I - K h) P (I - K h)' + K R K' whatever K is, and so positive where K is rounded."""
    kernel = filter_of("online").kernels("joseph")[1]
    used = set().union(*(one.free_symbols for stage in kernel.stages for one in stage.expressions))
    used = used.union(*(one.free_symbols for stage in kernel.outputs for one in stage.expressions))
    symbols = {str(one): one for one in used}

    def named(name: str) -> sp.Symbol:
        return symbols.get(name, sp.Symbol(name))

    n, K = 2, [symbols["K_1"], symbols["K_2"]]
    values: dict[sp.Symbol, sp.Expr] = {}
    for stage in kernel.stages:
        for symbol, expression in zip(map(named, stage.signal.elements), stage.expressions, strict=True):
            if symbol not in K:
                values[symbol] = expression.xreplace(values)
    found = next(stage for stage in kernel.outputs if stage.signal.name == "next_covariance")
    p = next(one for one in kernel.inputs if one.name == "covariance")
    p = list(map(named, p.elements))
    P, h, R = sp.Matrix([[p[0], p[1]], [p[1], p[2]]]), sp.Matrix([[1, 0]]), sp.Rational(1, 100)
    left = sp.eye(n) - sp.Matrix(K) * h
    expected = left * P * left.T + sp.Matrix(K) * R * sp.Matrix(K).T
    for place, expression in zip([(0, 0), (0, 1), (1, 1)], found.expressions, strict=True):
        assert sp.expand(expression.xreplace(values) - expected[place]) == 0


@pytest.mark.parametrize(
    "value", ["exp(800)", "exp(1000000)", "exp(10**30)", "exp(-10**30)", "1e61", "1/10**61"]
)
def test_numbers_out_of_all_measure_are_refused(value, tmp_path, capsys):
    path = tmp_path / "filter.toml"
    path.write_text(TEXT.replace("damping = 0.5", f'damping = "{value}"'))
    status, out, err = says(["kalman", str(path)], capsys)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "parameters.damping has a magnitude outside 1e-60 to 1e60" in err


def test_a_form_stands_in_the_command_of_the_code(tmp_path, capsys):
    path, out = tmp_path / "filter.toml", tmp_path / "out"
    path.write_text(TEXT.replace('"steady"', '"online"'))
    line = ["kalman", str(path), "--form", "ud", "--out", str(out)]
    assert says(line, capsys)[::2] == (0, "")
    header = " ".join((out / "oscillator_fix_update.h").read_text().replace("\n *", " ").split())
    assert f"strapgen kalman {path} --form ud --target c " in header
    assert "the same command with --check shows the differences" in header and "verify" not in header
    assert says([*line, "--check"], capsys)[0] == 0
    assert says([*line[:2], "--out", str(out), "--check"], capsys)[0] == 1


@pytest.mark.parametrize("kind", ["steady", "scheduled"])
def test_a_form_goes_with_online_gains(kind, tmp_path, capsys):
    path = tmp_path / "filter.toml"
    path.write_text(TEXT.replace('"steady"', f'"{kind}"\nduration = 6'))
    status, out, err = says(["kalman", str(path), "--form", "joseph"], capsys)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"form is 'joseph'; it goes with online gains, and not with {kind} ones" in err
