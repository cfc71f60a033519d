"""Velocity and position over a step: their order by every method, and other derivations."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from derived import kernel
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import strapgen
from strapgen.analysis.series import velocity_series
from strapgen.catalogue import choose
from strapgen.catalogue.methods.windows import named_window
from strapgen.ir.exceptions import InputError
from strapgen.kernel.power_series import Powers, outputs

NAME = "velocity-position"
#: A method of every family with its samples: of the step, from before it, from after it.
FAMILIES = {
    "rk1": (1, 0, 0),
    "rk4": (2, 0, 0),
    "coning-compressed": (1, 1, 0),
    "coning-combined": (2, 1, 0),
    "window-3-3": (1, 3, 3),
}
MORE = {
    "rk3": (2, 0, 0),
    "taylor4": (4, 0, 0),
    "magnus4": (1, 1, 1),
    "magnus6": (3, 0, 0),
    "munthe-kaas4": (2, 0, 0),
    "crouch-grossman3": (2, 0, 0),
    "fit-exact": (2, 0, 0),
    "coning-uncompressed": (3, 0, 0),
    "coning-polynomial": (2, 2, 0),
    "coning-exact-rest": (2, 0, 0),
}
EVERY = [*FAMILIES, *(pytest.param(name, marks=pytest.mark.long) for name in MORE)]


def chosen(method: str):
    increments, previous, ahead = {**FAMILIES, **MORE}[method]
    return choose(NAME, method, increments, previous=previous, ahead=ahead)


@pytest.mark.parametrize("method", EVERY)
def test_the_error_begins_where_that_of_the_attitude_does_for_any_motion_and_force(method):
    choice = chosen(method)
    series = velocity_series.series(choice)
    assert choice.increments is not None
    order = kernel(choice).order.step
    assert min(series.velocity) >= order + 1
    assert min(series.position) >= order
    if method in FAMILIES and method != "rk1":  # whose velocity is better than its attitude
        assert min(series.velocity) == order + 1


def test_the_position_takes_the_force_that_is_still_to_act():
    """Without rotation a quadratic force moves the body by the exact double integral, from three samples."""
    derived = kernel(choose(NAME, "coning-combined", 3))
    a, t = sp.symbols("a0:3"), sp.Symbol("t")
    force = sum(c * t**k for k, c in enumerate(a))
    third = sp.Rational(1, 3)
    samples = [sp.integrate(force, (t, k * third, (k + 1) * third)) for k in range(3)]
    values = dict.fromkeys(derived.inputs[0].elements, sp.Integer(0))
    values |= dict.fromkeys(derived.inputs[1].elements, sp.Integer(0))
    values |= {f"v{k + 1}_y": sample for k, sample in enumerate(samples)}
    out = derived.expand(values)
    assert sp.expand(out["velocity_change"][1] - sp.integrate(force, (t, 0, 1))) == 0
    assert sp.expand(out["position_change"][1] - sp.integrate((1 - t) * force, (t, 0, 1))) == 0


@pytest.mark.parametrize("name", ["window-3-3", pytest.param("window-7-7", marks=pytest.mark.long)])
def test_to_first_order_in_the_rate_a_window_has_the_closed_form(name):
    """dv = a0 + c0 x a0/2 + sum (c_m x a_(m+1) - c_(m+1) x a_m)/(2(2m+1)(2m+3))."""
    window = named_window(name)
    derived, rng = kernel(choose(NAME, name)), np.random.default_rng(1)
    count = window.total_increments
    angles, forces = (
        [[Fraction(int(x), 64) for x in rng.integers(-9, 10, 3)] for _ in range(count)] for _ in range(2)
    )
    ring = sp.ring("z", sp.QQ)[0]
    values = {
        element: Powers(ring, {power: ring(sp.Rational(x.numerator, x.denominator))}, 1)
        for signal, rows, power in zip(derived.inputs, (angles, forces), (1, 0), strict=True)
        for element, x in zip(signal.elements, [x for row in rows for x in row], strict=True)
    }
    computed = outputs(derived, values, ring, 1)["velocity_change"]

    def legendre(rows, m):
        return sp.Matrix(
            [
                sum((f * row[axis] for f, row in zip(window.filters[m], rows, strict=True)), Fraction(0))
                for axis in range(3)
            ]
        )

    c, a = ([legendre(rows, m) for m in range(window.degree + 1)] for rows in (angles, forces))
    expected = c[0].cross(a[0]) / 2
    for m in range(window.degree):
        expected += (c[m].cross(a[m + 1]) - c[m + 1].cross(a[m])) / (2 * (2 * m + 1) * (2 * m + 3))
    for axis in range(3):
        zeroth, first = (computed[axis].parts.get(power, ring.zero) for power in (0, 1))
        assert sp.nsimplify(zeroth.as_expr()) == sp.nsimplify(a[0][axis])
        assert sp.nsimplify(first.as_expr()) == sp.nsimplify(expected[axis])


def integrated(rate, force):
    """Return velocity and position change over a unit step, by a solver of differential equations of SciPy."""

    def derivative(t, y):
        turn = Rotation.from_quat(y[:4]).as_matrix()
        w, q = rate(t), y[:4]
        dq = 0.5 * np.array([*(q[3] * w + np.cross(q[:3], w)), -q[:3] @ w])
        return np.concatenate([dq, turn @ force(t), y[4:7]])

    start = [0, 0, 0, 1, *6 * [0]]
    end = solve_ivp(derivative, (0, 1), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return end[4:7], end[7:10]


def test_a_window_agrees_with_a_solver_of_differential_equations(rng):
    increments, previous, ahead = FAMILIES["window-3-3"]
    # Cubic in time, which its filters see exactly.
    rate = [rng.normal(size=3) * 0.03 * 0.5**k for k in range(4)]
    force = [rng.normal(size=3) * 0.5**k for k in range(4)]

    def at(parts):
        return lambda t: sum(p * t**k for k, p in enumerate(parts))

    def samples(parts):
        edges = np.arange(-previous, increments + ahead + 1) / increments
        whole = sum(np.outer(edges ** (k + 1) / (k + 1), p) for k, p in enumerate(parts))
        return np.diff(whole, axis=0)

    computed = strapgen.evaluator(choose(NAME, "window-3-3"))(samples(rate), samples(force))
    # The term of order n in the rate is at most angle^n/n! times the force; those from the fifth on are left out.
    angle, pushed = (sum(np.linalg.norm(part) for part in parts) for parts in (rate, force))
    for one, other in zip(computed, integrated(at(rate), at(force)), strict=True):
        assert np.abs(one - other).max() < angle**5 / 120 * pushed


@pytest.mark.parametrize("name", ["dcm", "euler"])
def test_translation_integrates_gravity_and_changes(name, rng):
    turn = Rotation.random(rng=rng)
    state = turn.as_matrix() if name == "dcm" else turn.as_quat()
    gained, moved, v, r, g = rng.normal(size=(5, 3))
    velocity, position = strapgen.evaluator(f"{name}-translation")(state, gained, moved, v, r, g, 0.1)
    np.testing.assert_allclose(velocity, v + turn.apply(gained) + 0.1 * g, atol=1e-14)
    np.testing.assert_allclose(position, r + 0.1 * (v + turn.apply(moved) + 0.05 * g), atol=1e-14)


def test_rates_at_nodes_are_refused():
    with pytest.raises(InputError, match="takes increments; rates at nodes"):
        choose(NAME, "rk4", rates=True)
