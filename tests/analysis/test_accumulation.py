"""From one step to a run: secular and bounded drift, orthonormalization, and a constant rate in closed form."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp

from strapgen.analysis.series.constant_rate import ANGLE, STEPS, ConstantRate, constant_rate, errors_after
from strapgen.analysis.series.error_rate import accumulate, error_rate
from strapgen.analysis.series.motion_rates import TIME
from strapgen.analysis.series.prediction import SETTINGS, agreement, agreement_text, parts_of
from strapgen.analysis.series.series import STEP
from strapgen.catalogue import ALGORITHMS, MOTIONS, choose, choose_step
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import exact_attitudes
from strapgen.run import exact

a, b, g = sp.symbols("a b g")


# In this order the quick tests take rk2 on the sinusoid, of which the time derivative of the error shows.
@pytest.mark.parametrize("method", ["rk4", "rk2", "rk3", "rk1"])
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
@pytest.mark.parametrize("name", MOTIONS)
def test_prediction_leaves_the_next_order(name, algorithm, method):
    """In 40 digits, as the step is halved: two powers of the error rate leave the third, or better."""
    found = agreement(choose(algorithm, method, 2), motion(name, **SETTINGS[name]), ["1/16", "1/32"], 0.5)
    assert found.slopes[-1] > found.order + found.terms - 0.15
    assert found.rungs[-1].difference < 0.02 * found.rungs[-1].drift
    assert "slope" in agreement_text(found)


@pytest.mark.long
@pytest.mark.parametrize("method", ["butcher5", "magnus4", "munthe-kaas4", "taylor6", "three-eighths"])
@pytest.mark.parametrize("name", ["coning", "sinusoidal"])
def test_prediction_leaves_the_next_order_for_other_methods(name, method):
    found = agreement(choose("euler", method, 3), motion(name, **SETTINGS[name]), ["1/16", "1/32"], 0.5)
    if found.order is None:
        assert found.rungs[-1].drift < 1e-30
    else:
        assert found.slopes[-1] > found.order + found.terms - 0.15


@pytest.mark.long
@pytest.mark.parametrize(
    "order", [1, pytest.param(2, marks=pytest.mark.long), pytest.param(3, marks=pytest.mark.long), 4]
)
def test_constant_rate_adds_up_along_the_rate(order):
    run = accumulate(choose("dcm", f"rk{order}", 2), "constant", 1)
    w = sp.Matrix(sp.symbols("w_x w_y w_z"))
    (power,) = run.secular
    coefficient = {
        1: sp.Rational(1, 3),
        2: -sp.Rational(1, 6),
        3: -sp.Rational(1, 30),
        4: sp.Rational(1, 120),
    }
    wanted = coefficient[order] * w.dot(w) ** (power // 2) * w
    assert (run.secular[power] - wanted).expand().is_zero_matrix
    assert not run.bounded


@pytest.mark.long
@pytest.mark.parametrize(
    ("order", "power"),
    [(1, 1), pytest.param(2, 2, marks=pytest.mark.long), (3, 4), pytest.param(4, 4, marks=pytest.mark.long)],
)
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_drift_on_a_sinusoid_is_bounded(algorithm, order, power):
    """The thesis's third-order guess, b^3 where a = b, is wrong: third order grows with b^4, as the fourth does."""
    run = accumulate(choose(algorithm, f"rk{order}", 2), "sinusoidal", 1)
    assert not run.secular
    assert list(run.bounded) == [power]
    about_y = run.bounded[power][1]
    assert sp.simplify(about_y.subs(TIME, TIME + 2 * sp.pi / b) - about_y) == 0
    # With a = b it is b^power times a function of the angle b t alone.
    scaled = sp.expand(about_y.subs(a, b).subs(TIME, TIME / b) / b**power)
    assert b not in scaled.free_symbols


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "share"),
    [
        pytest.param("rk1", 1, marks=pytest.mark.long),
        ("rk2", 4),
        pytest.param("rk4", 16, marks=pytest.mark.long),
    ],
)
def test_drift_ratio_on_a_sinusoid(method, share):
    """Table 3: the ratio of Euler parameters to direction cosines is 1, 1/4, 1/16, at all times."""
    ours, theirs = (accumulate(choose(name, method, 2), "sinusoidal", 1).bounded for name in ("euler", "dcm"))
    (power,) = ours
    assert sp.expand(share * ours[power][1] - theirs[power][1]) == 0


@pytest.mark.parametrize(
    "method", ["rk2", *(pytest.param(m, marks=pytest.mark.long) for m in ("rk3", "magnus4"))]
)
def test_coning_adds_up_along_its_axis(method):
    """Without the constant rate's own part: what is secular is along (0, b + g, a), the bounded part has no mean."""
    run = accumulate(choose("euler", method, 2), "coning", 1)
    (row,) = run.secular.values()
    assert row[0] == 0
    assert sp.cancel(row[1] * a - row[2] * (b + g)) == 0
    (swing,) = run.bounded.values()
    length = sp.sqrt(a**2 + b**2 + 2 * b * g + g**2)
    axis = sp.Matrix([0, b + g, a])
    along = sp.simplify(swing.dot(axis))
    assert along == 0
    assert sp.simplify(swing.subs(TIME, 2 * sp.pi / length)).is_zero_matrix


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "method"), [("dcm", "rk4"), ("euler", "rk2")])
def test_drift_over_hours_is_the_secular_rate(algorithm, method, simulated):
    """A long run on the thesis's motion: what grows is the closed form, its swing the bounded part."""
    profile = motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    run = accumulate(choose(algorithm, method, 2), "coning", 2)
    values = {STEP: 0.125, **{sp.Symbol(k): v for k, v in profile.parameters.items()}}
    drift = sp.lambdify(TIME, [x.subs(values) for x in run.drift()], "numpy")
    made = simulated(algorithm, method, profile, 5)
    wanted = np.array(np.broadcast_arrays(*drift(made.time))).T
    # To first order in the error: the square of the scale error of 5 s and of the drift are left, below 1 %.
    assert np.abs(made.drift - wanted).max() < 0.01 * np.abs(wanted).max()


def test_first_order_on_coning_needs_products_of_errors():
    """Its secular drift comes with h^2 while errors are of order h: the eigenvalue has them, to all orders.

    The bounded drift has none of them: it ends before the power of the first product of two errors, although the error
    rate goes on.
    """
    step = choose("euler", "rk1", 2)
    assert {1, 2} <= {*error_rate(step, "coning", 2).matrices}
    run = accumulate(step, "coning", 2)
    assert list(run.secular) == [2, 4]
    assert list(run.bounded) == [1]


@pytest.mark.long
def test_growth_of_scale_is_that_of_the_closed_form():
    run = accumulate(choose("dcm", "rk4", 2), "constant", 1)
    square = sum(x**2 for x in sp.symbols("w_x w_y w_z"))
    assert sp.expand(run.growth[5] + square**3 / 144) == 0


def test_missing_closed_form_is_reported(own_algorithm):
    with pytest.raises(InputError, match="not linear in its state"):
        error_rate(choose_step(str(own_algorithm("mrp"))), "coning")
    with pytest.raises(InputError, match="motion 'spin' is not known"):
        accumulate(choose("dcm"), "spin")
    with pytest.raises(InputError, match="takes no increments"):
        agreement(choose("dcm", "rk4", rates=True), motion("constant", y_deg_s=1), ["1/8"], 1)


RATES = {
    "one axis": {"y_deg_s": 10},
    "three axes": {"x_deg_s": 10, "y_deg_s": 10, "z_deg_s": 10},
    "any axis": {"x_deg_s": -7, "y_deg_s": 3, "z_deg_s": 5},
}
STEP_S = Fraction(1, 8)


@cache
def closed_form(algorithm: str, method: str) -> ConstantRate:
    """Return the closed form of a step from two increments."""
    return constant_rate(choose(algorithm, method, 2))


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("order", range(1, 9))
def test_the_state_turns_as_the_cut_exponential(algorithm, order):
    """For any order: direction cosines by exp(i x), parameters by exp(i x/2), cut at the order."""
    found = closed_form(algorithm, f"taylor{order}")
    angle = ANGLE if algorithm == "dcm" else ANGLE / 2
    cut = sum((sp.I * angle) ** k / sp.factorial(k) for k in range(order + 1))
    assert sp.expand(found.cosine + sp.I * found.sine - cut) == 0
    assert found.parameters == (algorithm != "dcm")


@pytest.mark.long
@pytest.mark.parametrize("order", range(1, 5))
def test_a_runge_kutta_step_is_the_taylor_step_there(order):
    """Where the order is the number of stages; Cayley-Klein parameters have the programs of Euler parameters."""
    for algorithm in ("dcm", "euler"):
        ours, taylor = (closed_form(algorithm, f"{m}{order}") for m in ("rk", "taylor"))
        assert (ours.cosine, ours.sine) == (taylor.cosine, taylor.sine)


def test_first_order_error_has_the_expected_size():
    x = ANGLE
    assert constant_rate(choose("dcm", "rk1")).angle_lost == x - sp.atan(x)
    assert constant_rate(choose("euler", "rk1")).angle_lost == x - 2 * sp.atan(x / 2)
    assert constant_rate(choose("dcm", "rk1")).stretch == sp.sqrt(1 + x**2)
    assert constant_rate(choose("euler", "rk1")).stretch == 1 + x**2 / 4


@pytest.mark.long
@pytest.mark.parametrize("method", ["rk1", "rk2", "rk3", "rk4", "taylor7", "fehlberg5"])
def test_the_series_is_that_of_the_closed_form(method):
    found = closed_form("euler", method)
    terms = found.series(2)
    with mpmath.workdps(60):
        wanted = mpmath.taylor(sp.lambdify(ANGLE, found.angle_lost, "mpmath"), 0, max(terms))
        for power, value in enumerate(wanted):
            term = terms.get(power, sp.S.Zero)
            assert abs(value - mpmath.mpf(term.p) / term.q) < 1e-12


@pytest.mark.long
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_nine_errors_in_symbols(algorithm, rate):
    """The formulas in N are those of a run that is followed; drift is along the rate."""
    choice = choose(algorithm, "rk2", 2)
    profile = motion("constant", **RATES[rate])
    followed = errors_after(choice, profile, STEP_S, 180)
    formulas = closed_form(algorithm, "rk2").errors()
    symbols = sp.symbols("w_x w_y w_z h")
    with mpmath.workdps(exact.DIGITS):
        values = [*map(mpmath.mpf, profile.parameters.values()), exact.number(STEP_S), 1440]
        for part in ("drift", "scale", "skew"):
            wanted = getattr(followed, part)[-1]
            found = sp.lambdify([*symbols, STEPS], formulas[part], "mpmath")(*values)
            assert all(abs(x - y) < 1e-30 for x, y in zip(found, wanted, strict=True))


@pytest.mark.long
@pytest.mark.parametrize("every", [None, 5], ids=["plain", "orthonormalized"])
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_a_run_of_1440_steps(algorithm, order, rate, every, simulated):
    """All nine errors, orthonormalized by the algorithm's own scheme or not, to 1e-7 of the largest of their kind.

    In double a run of 1,440 steps rounds by some 1e-13, which fourth order shows; so its errors are held to that, and
    to 1e-7 in arithmetic of many digits below.
    """
    choice = choose(algorithm, f"rk{order}", 2)
    profile = motion("constant", **RATES[rate])
    expected = errors_after(choice, profile, STEP_S, 180, every, 5)
    run = simulated(algorithm, f"rk{order}", profile, every)
    for part in ("drift", "scale", "skew"):
        wanted = np.array([[float(x) for x in row] for row in getattr(expected, part)])
        assert np.abs(getattr(run, part) - wanted).max() < 1e-7 * np.abs(wanted).max() + 2e-12


@pytest.mark.long
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_a_run_in_many_digits(algorithm, order):
    """Rounding hides nothing: every one of the nine errors agrees to 1e-25 of the largest."""
    choice = choose(algorithm, f"rk{order}", 2)
    profile = motion("constant", **RATES["any axis"])
    expected = errors_after(choice, profile, STEP_S, 25)
    with mpmath.workdps(exact.DIGITS):
        *_, (computed, true) = exact_attitudes(choice, profile)(STEP_S, 200)
        for part, wanted in zip(
            parts_of()(computed, true), (expected.scale, expected.skew, expected.drift), strict=True
        ):
            largest = max(map(abs, wanted[-1]))
            assert all(abs(a - b) <= 1e-25 * largest + 1e-34 for a, b in zip(part, wanted[-1], strict=True))


def test_the_thesis_base_drifts():
    """Section 7: 0.2855 deg on one axis, 0.856 deg on three, 2.391 deg without orthonormalization."""
    choice = choose("dcm", "rk1", 2)

    def drift(rate: str, every: int | None) -> float:
        return math.degrees(
            max(errors_after(choice, motion("constant", **RATES[rate]), STEP_S, 180, every, 5).drift_by_axis)
        )

    assert drift("one axis", 5) == pytest.approx(0.2855, abs=5e-5)
    assert drift("three axes", 5) == pytest.approx(0.856, abs=5e-4)
    assert drift("three axes", None) == pytest.approx(2.391, abs=5e-4)
