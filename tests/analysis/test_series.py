"""Truncation-error series: order, JSON, every kind of step, the words of a report; and appendix B of the thesis."""

from __future__ import annotations

import json

import mpmath
import pytest
import sympy as sp

from strapgen.analysis.error_analysis import analyse, series_latex, series_text
from strapgen.analysis.series.invariants import LATEX, covariant_text
from strapgen.analysis.series.series import ERROR, MOTIONS, STEP, effect, series
from strapgen.catalogue import (
    ALGORITHMS,
    METHODS,
    choose,
    choose_step,
    derive,
    enough,
    nodes,
    orthonormalizations,
)
from strapgen.ir.exceptions import InputError
from strapgen.run import exact
from strapgen.run.exact import interpreter

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
def test_json_keeps_its_keys(motion, terms):
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
def test_kernels_without_series_are_refused(chosen, arguments, says):
    with pytest.raises(InputError, match=says):
        series(choose(*chosen), *arguments)


P = ERROR
K, Y = (P - P.T) / 2, (P + P.T) / 2
SERIES = ["dcm-orthonormalize", "dcm-orthonormalize-first-order", "dcm-orthonormalize-second-order"]


def is_zero(matrix: sp.Matrix) -> bool:
    return bool(matrix.expand().is_zero_matrix)


def nearest_to_second_order() -> sp.Matrix:
    """Return the s^2 of (I + sP) ((I + sP)'(I + sP))^(-1/2), equation (B.1).

    The binomial series of the root is I - E/2 + 3/8 E^2 - ..., of E = s (P + P') + s^2 P'P.
    """
    first, second = P + P.T, P.T * P
    return -second / 2 + sp.Rational(3, 8) * first * first - P * first / 2


@pytest.mark.parametrize("scheme", SERIES)
def test_to_first_order_the_skew_part_is_left(scheme):
    """(B.4): scale and skew vanish, and drift is unchanged."""
    assert is_zero(effect(scheme, 1)[1] - K)


def test_to_second_order():
    """(B.14), which is the series of the nearest rotation."""
    second = effect("dcm-orthonormalize-second-order")[2]
    assert is_zero(second - (-P * P - P * P.T - P.T * P + 3 * P.T * P.T) / 8)
    assert is_zero(second - nearest_to_second_order())


@pytest.mark.long
@pytest.mark.parametrize("scheme", SERIES)
def test_second_order_error_after_each_scheme(scheme):
    """Drift changes by half of KY + YK, whatever the scheme; they differ in what is left of scale and skew.

    Of the symmetric error the second order leaves nothing beside the K^2/2 of a rotation; the first one the root of
    1 - 3/4 (2Y)^2; and the scheme of the thesis, whose rows have length 1, a skew.
    """
    second = effect(scheme)[2]
    cofactors = Y.adjugate()
    remainder = {
        "dcm-orthonormalize": (cofactors - sp.diag(*cofactors.diagonal())) / 2,
        "dcm-orthonormalize-first-order": -sp.Rational(3, 2) * Y * Y,
        "dcm-orthonormalize-second-order": sp.zeros(3, 3),
    }
    assert is_zero((second - second.T) / 2 + (K * Y + Y * K) / 2)
    assert is_zero((second + second.T) / 2 - K * K / 2 - remainder[scheme])


def test_scale_alone_lets_the_drift_of_a_large_error_fall():
    """Claim 6: with the scale y and the drift k about one axis, drift falls by y k."""
    y, k = sp.symbols("y k")
    error = sp.Matrix([[y, k, 0], [-k, y, 0], [0, 0, 0]])
    values = dict(zip(P, error, strict=True))
    second = effect("dcm-orthonormalize-second-order")[2].subs(values)
    assert sp.expand((second - second.T)[0, 1] / 2 + y * k) == 0


@pytest.mark.long
@pytest.mark.parametrize("scheme", orthonormalizations("dcm"))
def test_any_true_matrix(scheme):
    """The kernels, that of the nearest rotation too, on (I + sP) C: what they leave is as predicted, to order s^3."""
    name = scheme if scheme in SERIES else "dcm-orthonormalize-second-order"
    values = {symbol: sp.Rational((5 * n) % 7 - 3, 4) for n, symbol in enumerate(P)}
    terms = {power: matrix.subs(values) for power, matrix in effect(name).items()}
    with mpmath.workdps(exact.DIGITS):
        true = mpmath.matrix(3, 3)
        rows = interpreter("dcm-from-euler")([mpmath.mpf(x) / 5 for x in (1, 2, 2, 4)])
        for k, x in enumerate(rows):
            true[k // 3, k % 3] = x
        left = []
        for size in (mpmath.mpf(1) / 1000, mpmath.mpf(1) / 2000):
            error = mpmath.matrix(P.subs(values).tolist()) * size
            made = interpreter(scheme)(list((mpmath.eye(3) + error) * true))
            expected = mpmath.eye(3) + sum(
                (mpmath.matrix(m.tolist()) * size**power for power, m in terms.items()), mpmath.zeros(3)
            )
            wanted = list(expected * true)
            left.append(max(abs(a - b) for a, b in zip(made, wanted, strict=True)))
        assert left[0] < 1e-7
        assert float(mpmath.log(left[0] / left[1], 2)) == pytest.approx(3, abs=0.05)


def test_orthonormalization_without_effect_changes_no_series():
    with pytest.raises(InputError, match="has no series in the error"):
        effect("dcm-orthonormalize-optimal")
    with pytest.raises(InputError, match="scheme 'dcm' is not known"):
        effect("dcm")
