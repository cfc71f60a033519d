"""Truncation-error series: order, contract of the JSON, every kind of step, and the words of a report."""

from __future__ import annotations

import json

import pytest
import sympy as sp

from strapgen.analysis.error_analysis import analyse, series_latex, series_text
from strapgen.analysis.series.invariants import LATEX, covariant_text
from strapgen.analysis.series.series import MOTIONS, STEP, series
from strapgen.catalogue import ALGORITHMS, METHODS, choose, choose_step, derive, enough, nodes
from strapgen.ir.exceptions import InputError

W = sp.symbols("w_x w_y w_z")
RANK = {"rk1": 1, "rk2": 2, "rk3": 3, "rk4": 4}


@pytest.mark.long
@pytest.mark.parametrize("method", RANK)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_the_order_is_that_of_theory_or_better(algorithm, motion, method):
    order, rank = series(choose(algorithm, method, 2), motion, 1).order, RANK[method]
    assert order == rank if motion in ("general", "coning") else order >= rank


@pytest.mark.long
@pytest.mark.parametrize(("motion", "terms"), [("constant", 2), ("general", 1)])
def test_json_is_what_was_agreed(motion, terms):
    data = json.loads(json.dumps(analyse(choose("euler", "rk4", 2), motion, terms).as_dict()))
    assert data["order"] == 4
    letters = W if motion == "constant" else [sp.Symbol(f"w{j}_{axis}") for j in range(9) for axis in "xyz"]
    for part in ("drift", "scale", "skew"):
        assert len(data[part]) == 3
        for text in data[part]:
            assert sp.sympify(text).free_symbols <= {STEP, *letters}
    assert ("invariant" in data) == (motion == "general")
    if motion == "general":
        used = set().union(*(sp.sympify(text).free_symbols for text in data["drift"]))
        assert {sp.Symbol("w0_x"), sp.Symbol("w3_z")} <= used


def test_the_vector_invariant_form_is_the_components():
    found = series(choose("dcm", "rk2", 1), "general", 1)
    assert covariant_text(found.invariant[3].drift) == "-1/6 |w0|^2 w0 + 1/12 w0 x w1"
    w0, w1 = (sp.Matrix(sp.symbols(f"w{j}_x w{j}_y w{j}_z")) for j in (0, 1))
    wanted = w0.cross(w1) / 12 - w0.dot(w0) * w0 / 6
    assert all(sp.expand(a - b) == 0 for a, b in zip(found.drift[3], wanted, strict=True))
    assert r"\boldsymbol\omega_{0} \times \boldsymbol\omega_{1}" in covariant_text(
        found.invariant[3].drift, notation=LATEX
    )


@pytest.mark.long
def test_exponentials_lose_nothing_at_a_constant_rate():
    found = analyse(choose("dcm", "magnus4", 2), "constant")
    assert found.step.order is None
    assert "nothing, to the power" in series_text(found)


@pytest.mark.parametrize("method", ["rk4", "magnus4", "fehlberg5"])
def test_a_step_that_takes_rates(method):
    """Rates at the nodes are exact: the order is the method's own."""
    choice = choose("euler", method, rates=True)
    assert len(nodes(choice)) > 1
    assert series(choice, "coning", 1).order == int(method[-1])


@pytest.mark.long
@pytest.mark.parametrize(
    "method",
    [
        n
        for n in METHODS
        if not n.startswith(
            ("taylor", "fit", "ralston", "butcher", "nystrom", "fehlberg7", "fehlberg8", "cooper-verner8")
        )
    ][::2],
)
def test_every_method_has_its_order_on_a_general_motion(method):
    """The order that theory gives the step; methods of irrational and of rounded coefficients too."""
    choice = choose("euler", method, enough(method))
    assert series(choice, "general", 1).order == derive(choice).order.step


@pytest.mark.long
def test_irrational_coefficients_stay_exact():
    found = series(choose("euler", "cooper-verner8", 6), "constant", 1)
    (coefficient,) = {row[1] for row in found.drift.values()}
    assert coefficient.has(sp.sqrt(21))
    assert min(found.drift) == 9


@pytest.mark.long
def test_rounded_coefficients_show_no_order_that_is_not_there():
    found = series(choose("euler", "dormand-prince8", 6), "constant", 1)
    assert min(found.drift) == 9


def test_a_users_step_that_is_not_linear_has_no_closed_form_of_a_run(own_algorithm):
    choice = choose_step(str(own_algorithm("mrp")))
    found = analyse(choice, "constant", 1)
    assert found.step.order == 4
    assert found.run is None
    assert "not linear in its state" in series_text(found)


@pytest.mark.parametrize(
    "motion",
    [pytest.param(m, marks=() if m in ("constant", "sinusoidal") else pytest.mark.long) for m in MOTIONS],
)
def test_reports_say_every_part(motion):
    found = analyse(choose("dcm", "rk2", 2), motion, 1)
    text = series_text(found)
    assert "order 2" in text
    assert "growth in a step" in text
    assert ("in closed form" in text) == (motion == "constant")
    latex = series_latex(found)
    assert latex.count(r"\begin{align*}") == latex.count(r"\end{align*}") == 1


@pytest.mark.parametrize(
    ("chosen", "arguments", "says"),
    [
        (("euler", "rk4", 2), ("spin", 2), "motion 'spin' is not known; allowed: general, constant"),
        (("euler", "rk4", 2), ("general", 7), "terms is 7; a whole number from 1 to 6"),
        (("euler-normalize",), ("general", 2), "no attitude step"),
    ],
)
def test_what_has_no_series(chosen, arguments, says):
    with pytest.raises(InputError, match=says):
        series(choose(*chosen), *arguments)
