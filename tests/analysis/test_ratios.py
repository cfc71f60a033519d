"""Ratios and the overview: the thesis's claims derived, two algorithms side by side, and the whole catalogue."""

from __future__ import annotations

import json
import math

import pytest
import sympy as sp

from strapgen.analysis.overview import OverviewResult, choices, methods, overview
from strapgen.analysis.ratios import claims, claims_text, quotient, ratio_latex, ratio_text, versus
from strapgen.analysis.series.constant_rate import ANGLE, constant_rate
from strapgen.catalogue import METHODS, choose
from strapgen.catalogue.methods.shaped_coning import SHAPE_TITLES
from strapgen.catalogue.methods.windows import WINDOW_TITLES

R = sp.Rational


def test_the_claims_of_section_8():
    """With sign and with the next term in x^2."""
    found = [claim.ratio for claim in claims()]
    assert found == [
        {0: R(1, 4), 2: R(9, 80)},
        {0: R(1, 4), 2: R(9, 160)},
        {0: R(1, 16), 2: R(5, 896)},
        {0: R(1, 16), 2: R(15, 896)},
        {0: -R(1, 2), 2: -R(3, 20)},
        {0: -R(1, 4), 2: R(5, 84)},
        {0: 3, 2: R(51, 35)},
    ]
    assert "1/4 + 9/80 x^2" in claims_text(claims())


@pytest.mark.long
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_parameter_error_is_twice_matrix_error_at_half_angle(order):
    """Claim 2 in closed form: the ratio is 2 delta(x/2)/delta(x), exactly."""
    euler, dcm = (constant_rate(choose(name, f"rk{order}", 2)) for name in ("euler", "dcm"))
    assert sp.simplify(euler.angle_lost - 2 * dcm.angle_lost.subs(ANGLE, ANGLE / 2)) == 0


@pytest.mark.long
def test_three_axes_at_the_thesis_rate():
    """3.00069 at 10 deg/s and 1/8 s."""
    ratio = claims()[-1].ratio
    x = math.radians(10) / 8
    assert float(sum(value * x**power for power, value in ratio.items())) == pytest.approx(3.00069, abs=1e-5)


@pytest.mark.parametrize(
    "motion", ["constant", "sinusoidal", pytest.param("polynomial", marks=pytest.mark.long)]
)
def test_second_order_loses_a_quarter(motion):
    ratio = versus(choose("euler", "rk2", 2), choose("dcm", "rk2", 2), motion).ratio
    assert ratio[0] == R(1, 4)


@pytest.mark.long
def test_steps_of_one_method_on_coning():
    """Exponentials of the same rotation vector lose the same, whatever the state."""
    found = versus(choose("euler", "magnus4", 2), choose("dcm", "magnus4", 2), "coning")
    assert found.ratio == {0: 1}
    assert found.expression == 1


def test_vectors_that_are_not_parallel_have_no_ratio():
    found = versus(choose("euler", "rk2", 2), choose("dcm", "rk2", 2), "general", 1)
    assert found.ratio is None
    assert "not parallel" in ratio_text(found)
    assert found.as_dict()["ratio"] is None


def test_an_exact_step_has_no_ratio():
    found = versus(choose("euler", "magnus4", 2), choose("dcm", "rk4", 2), "constant")
    assert "euler-magnus4-2 loses nothing" in ratio_text(found)


@pytest.mark.long
def test_quotient_is_the_series_of_the_quotient():
    first = {2: (R(1, 3),), 3: (R(1, 5),), 4: (R(-1, 7),)}
    second = {1: (R(2, 3),), 2: (R(-1, 2),), 3: (R(4),)}
    h = sp.Symbol("h")

    def total(terms):
        return sum(row[0] * h**power for power, row in terms.items())

    wanted = sp.series(total(first) / total(second), h, 0, 4).removeO()
    found = quotient(first, second, 3)
    assert sp.expand(wanted - sum(x * h**power for power, x in found.items())) == 0


def test_latex():
    text = ratio_latex(versus(choose("euler", "rk1"), choose("dcm", "rk1"), "constant"))
    assert text.startswith("%")
    assert r"\frac{9 x^{2}}{80}" in text


@pytest.mark.long
def test_rows():
    rows = list(overview([choose("dcm", "rk1", 1), choose("euler", "rk4", 2), choose("euler", "magnus2", 1)]))
    first, fourth, magnus = rows
    assert (first.order, first.constant_power, first.constant) == (1, 3, sp.Rational(1, 3))
    assert (fourth.constant_power, fourth.constant) == (5, sp.Rational(1, 1920))
    assert fourth.operations == 68
    assert magnus.constant is None
    assert magnus.contractive == "kept"
    # At the step where 544 operations a second do, 68 operations take 1/8 s.
    assert fourth.drift_at_equal_work_deg_h == fourth.coning_drift_deg_h
    text = OverviewResult(rows).text()
    assert "1/1920 x^5" in text
    assert "1/12 w0 x w1" in text
    data = json.loads(json.dumps([row.as_dict() for row in rows]))
    assert sp.sympify(data[1]["coning"]).free_symbols == set(sp.symbols("a b g"))


def test_the_whole_catalogue_is_offered():
    names = methods()
    assert {choice.method for choice in choices()} == set(names)
    series = {f"taylor{order}" for order in range(9, 21)} | {"fit-exact", "coning-exact-rest"}
    assert set(METHODS) - set(names) == series | set(WINDOW_TITLES) | set(SHAPE_TITLES)
