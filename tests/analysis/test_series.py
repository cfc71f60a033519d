"""Truncation-error series: the closed forms of a constant rate, the ratios of the thesis, the contract of the JSON."""

from __future__ import annotations

import json

import pytest
import sympy as sp

from strapgen.analysis import series as analysis
from strapgen.analysis.invariants import as_text
from strapgen.analysis.series import MOTIONS, STEP, series
from strapgen.catalogue import ALGORITHMS, choose
from strapgen.exceptions import InputError

W = sp.symbols("w_x w_y w_z")
SQUARE = sum(w**2 for w in W)
RANK = {"rk1": 1, "rk2": 2, "rk3": 3, "rk4": 4}


def drift_per_step(algorithm: str, order: int, terms: int) -> sp.Poly:
    """Return the angle that the method loses about a fixed axis in x = w h, from cos and sin cut at the order.

    A step by x turns direction cosines as the series of exp(i x), cut at the order, does; Euler parameters by half.
    """
    x = sp.Symbol("x")
    angle = x / 2 if algorithm == "euler" else x
    cut = sum((sp.I * angle) ** k / sp.factorial(k) for k in range(order + 1))
    power = cut**2 if algorithm == "euler" else cut
    error = sp.expand(power * sum((-sp.I * x) ** k / sp.factorial(k) for k in range(order + 8)))
    imaginary = sp.expand(sp.im(error.subs(x, sp.Symbol("x", real=True))))
    poly = sp.Poly(-imaginary, sp.Symbol("x", real=True))
    wanted = sorted((m[0], c) for m, c in poly.terms())[:terms]
    return sp.Poly({(power,): c for power, c in wanted}, x)


@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
@pytest.mark.parametrize("method", RANK)
def test_drift_at_a_constant_rate_is_that_of_the_cut_exponential(algorithm, method):
    found = series(choose(algorithm, method, 2), "constant", 2)
    expected = drift_per_step(algorithm, RANK[method], 2)
    for axis, expression in enumerate(found.expressions("drift")):
        # Odd powers of x = |w| h: the direction is that of the rate.
        wanted = sum(
            c * STEP**power * W[axis] * SQUARE ** ((power - 1) // 2) for (power,), c in expected.terms()
        )
        assert sp.expand(expression - wanted) == 0


@pytest.mark.parametrize(("method", "ratio"), [("rk1", 4), ("rk2", 4), ("rk3", 16), ("rk4", 16)])
def test_euler_parameters_lose_a_quarter_or_a_sixteenth(method, ratio):
    leading = []
    for algorithm in ("dcm", "euler"):
        found = series(choose(algorithm, method, 2), "constant", 1)
        (power,) = found.drift
        leading.append((power, found.drift[power][1]))
    assert leading[0][0] == leading[1][0]
    assert sp.simplify(leading[0][1] / leading[1][1]) == ratio


def test_second_order_drift_is_minus_a_half_of_first_and_fourth_minus_a_quarter_of_third():
    def leading(method: str) -> sp.Expr:
        (row,) = series(choose("dcm", method, 2), "constant", 1).drift.values()
        return row[2]

    assert sp.simplify(leading("rk2") / leading("rk1")) == -sp.Rational(1, 2)
    assert sp.simplify(leading("rk4") / leading("rk3")) == -sp.Rational(1, 4)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_order_is_that_of_theory_or_better(algorithm, motion):
    for method in ("rk1", "rk2", "rk4"):
        choice = choose(algorithm, method, 2)
        found = series(choice, motion, 1)
        assert found.order >= RANK[method]
        if motion in ("general", "coning"):
            assert found.order == RANK[method]


@pytest.mark.parametrize("motion", ["constant", "general"])
def test_json_is_what_was_agreed(motion):
    data = json.loads(analysis.as_json(series(choose("euler", "rk4", 2), motion, 2)))
    assert data["order"] == 4
    letters = W if motion == "constant" else [sp.Symbol(f"w{j}_{axis}") for j in range(9) for axis in "xyz"]
    for part in ("drift", "scale", "skew"):
        assert len(data[part]) == 3
        for text in data[part]:
            expression = sp.sympify(text)
            assert expression.free_symbols <= {STEP, *letters}
    assert ("invariant" in data) == (motion == "general")


def test_exponentials_lose_nothing_at_a_constant_rate():
    found = series(choose("dcm", "magnus4", 2), "constant")
    assert found.order is None
    assert "nothing, to the power" in analysis.as_report(found)


def test_the_vector_invariant_form_is_the_components():
    found = series(choose("dcm", "rk2", 2), "general", 1)
    (power,) = found.drift
    assert as_text(found.invariant[power].drift) == "1/24 w2 - 1/6 |w0|^2 w0 - 1/12 w0 x w1" or power == 3


@pytest.mark.parametrize(
    ("chosen", "arguments", "says"),
    [
        (("euler", "rk4", 2), ("spin", 2), "motion 'spin' is not known; allowed: general, constant"),
        (("euler", "rk4", 2), ("general", 7), "terms is 7; a whole number from 1 to 6"),
        (("euler", "rk4", None, True), ("general", 2), "takes no increments"),
    ],
)
def test_what_has_no_series(chosen, arguments, says):
    with pytest.raises(InputError, match=says):
        series(choose(*chosen), *arguments)
