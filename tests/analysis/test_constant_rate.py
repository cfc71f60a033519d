"""A constant rate in closed form: the cut exponential, and runs of 1,440 steps."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp

from strapgen.analysis.series.constant_rate import ANGLE, STEPS, ConstantRate, constant_rate, errors_after
from strapgen.analysis.series.prediction import parts_of
from strapgen.catalogue import ALGORITHMS, choose
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import exact_attitudes
from strapgen.run import exact

RATES = {
    "one axis": {"y_deg_s": 10},
    "three axes": {"x_deg_s": 10, "y_deg_s": 10, "z_deg_s": 10},
    "any axis": {"x_deg_s": -7, "y_deg_s": 3, "z_deg_s": 5},
}
STEP = Fraction(1, 8)


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


def test_what_the_first_order_loses():
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
    followed = errors_after(choice, profile, STEP, 180)
    formulas = closed_form(algorithm, "rk2").errors()
    symbols = sp.symbols("w_x w_y w_z h")
    with mpmath.workdps(exact.DIGITS):
        values = [*map(mpmath.mpf, profile.parameters.values()), exact.number(STEP), 1440]
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
    expected = errors_after(choice, profile, STEP, 180, every, 5)
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
    expected = errors_after(choice, profile, STEP, 25)
    with mpmath.workdps(exact.DIGITS):
        *_, (computed, true) = exact_attitudes(choice, profile)(STEP, 200)
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
            max(errors_after(choice, motion("constant", **RATES[rate]), STEP, 180, every, 5).drift_by_axis)
        )

    assert drift("one axis", 5) == pytest.approx(0.2855, abs=5e-5)
    assert drift("three axes", 5) == pytest.approx(0.856, abs=5e-4)
    assert drift("three axes", None) == pytest.approx(2.391, abs=5e-4)
