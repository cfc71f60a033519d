"""Updates by a rotation vector: the cut-off series against Taylor's, the exact form at every angle."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import algebra, derive
from strapgen.backends import BACKENDS
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.targets import FIXED

ORDERS = [1, 2, 3, 4, 5, 7, pytest.param(12, marks=pytest.mark.long)]
PRECISE = mpmath.mp.clone()
PRECISE.dps = 50


@pytest.mark.parametrize("order", ORDERS)
def test_the_series_cut_off_is_taylors_step_on_one_increment(algorithm, order):
    made, step = derive(f"{algorithm}-update-{order}"), derive(algorithm, f"taylor{order}", 1)
    ring, *symbols = sp.ring([f"x{k}" for k in range(made.inputs[0].size + 3)], sp.QQ)
    results = []
    for kernel in (made, step):
        names = [name for signal in kernel.inputs for name in signal.elements]
        results.append(kernel.expand(dict(zip(names, map(ring, symbols), strict=True)))["next"])
    assert [ring(x) for x in results[0]] == [ring(x) for x in results[1]]


def test_fifth_order_stops_where_the_source_says():
    # f1 after the fourth power of the angle, f2 after the second; f3 and f4 in the half angle.
    x = sp.Symbol("x")
    assert sp.expand(algebra.wave_series(x**2, 1, 5) - (1 - x**2 / 6 + x**4 / 120)) == 0
    assert sp.expand(algebra.wave_series(x**2, 2, 5) - (sp.Rational(1, 2) - x**2 / 24)) == 0
    v = sp.Matrix(sp.symbols("v1:4"))
    A = algebra.dot(v, v)
    q = algebra.quaternion(v, 4)
    assert sp.expand(q[3] - (1 - A / 8 + A**2 / 384)) == 0
    assert (q[:3, :] - v * (1 - A / 24) / 2).expand() == sp.zeros(3, 1)


@pytest.mark.parametrize("order", [1, 2, 3, 6])
def test_both_series_begin_as_the_functions(order):
    x = sp.Symbol("x", positive=True)
    for first, function in ((1, sp.sin(x) / x), (2, (1 - sp.cos(x)) / x**2), (0, sp.cos(x))):
        if first <= order:
            whole = sp.series(function, x, 0, order - first + 1).removeO()
            assert sp.expand(algebra.wave_series(x**2, first, order) - whole) == 0


def test_the_navigation_frame_of_second_order_is_the_sources():
    # (6): B = I - (theta x) + (theta x)^2 / 2. (15): r = (-theta/2, 1 - (theta/2)^2 / 2).
    theta = sp.Matrix(sp.symbols("theta_x theta_y theta_z", real=True))
    made = derive("dcm-navigation-update-2")
    C = sp.Matrix(3, 3, [sp.Symbol(n, real=True) for n in made.inputs[0].elements])
    K = algebra.skew(theta)
    wanted = (sp.eye(3) - K + K * K / 2) * C
    assert (sp.Matrix(3, 3, made.expand()["next"]) - wanted).expand() == sp.zeros(3, 3)
    made = derive("euler-navigation-update-2")
    q = sp.Matrix([sp.Symbol(n, real=True) for n in made.inputs[0].elements])
    r = sp.Matrix([*(-theta / 2), 1 - algebra.dot(theta, theta) / 8])
    wanted = algebra.quaternion_product(r, q)
    assert (sp.Matrix(made.expand()["next"]) - wanted).expand() == sp.zeros(4, 1)


@pytest.mark.parametrize("order", ["", "-1", "-2"])
def test_a_turn_of_both_frames_leaves_the_attitude(algorithm, order, rng):
    # A body at the reference attitude that turns with the navigation frame stays there, but for what is cut off.
    identity = np.array(KINEMATICS[algorithm].identity, float).squeeze()
    theta = rng.uniform(-1e-3, 1e-3, (20, 3))
    turned = strapgen.evaluator(f"{algorithm}-update{order}")(identity, theta)
    back = strapgen.evaluator(f"{algorithm}-navigation-update{order}")(turned, theta)
    left = {"": 4e-16, "-1": 4e-6, "-2": 1e-8}[order]
    assert np.abs(back - identity).max() <= left


def exact_transition(algorithm: str, phi: np.ndarray) -> list[mpmath.mpf]:
    vector = [PRECISE.mpf(float(x)) for x in phi]
    angle = PRECISE.sqrt(sum(x * x for x in vector))
    half = angle / 2
    q = [PRECISE.sinc(half) / 2 * x for x in vector] + [PRECISE.cos(half)]
    if algorithm == "cayley-klein":
        return [q[3], *q[:3]]
    if algorithm == "euler":
        return q
    x, y, z, s = q
    return [
        *(s * s + x * x - y * y - z * z, 2 * (x * y - s * z), 2 * (x * z + s * y)),
        *(2 * (x * y + s * z), s * s - x * x + y * y - z * z, 2 * (y * z - s * x)),
        *(2 * (x * z - s * y), 2 * (y * z + s * x), s * s - x * x - y * y + z * z),
    ]


#: Angles around every switch: no angle, squares that vanish, and all sizes up to more than half a turn.
SIZES = (0.0, 5e-324, 1e-200, 1e-154, 1e-30, 1e-16, 1.5e-8, 3e-5, 1e-3, 0.0625, 0.5, 0.999)


def test_the_exact_form_needs_no_switch(algorithm, backend_name):
    # sin(x)/x is as good near 0 as elsewhere; only at 0 it must be 1. In fixed point a polynomial of the square takes
    # its place, and the bound is certified.
    update = strapgen.evaluator(f"{algorithm}-update", backend_name)
    identity = np.array(KINEMATICS[algorithm].identity, float).squeeze()
    directions = np.array([[1, 0, 0], [0, -1, 0], [0.6, 0, 0.8], [2, -1, 2]], float)
    directions[3] /= 3
    phi = np.concatenate([size * directions for size in SIZES])
    if BACKENDS[backend_name].target in FIXED:
        (given, result), (state, _) = (
            (update.interface.inputs[1], update.interface.outputs[0]),
            update.interface.inputs,
        )
        phi = update.numbers(given, update.integers(given, phi))
        identity = update.numbers(state, update.integers(state, identity))
        allowed = np.array([float(error) for error in result.errors])
    else:
        phi = phi.astype(update.dtype).astype(float)
        allowed = np.full(identity.size, 4 * np.finfo(update.dtype).eps)
    made = update(identity.astype(update.dtype), phi.astype(update.dtype)).reshape(len(phi), -1)
    for row, vector in zip(made, phi, strict=True):
        wanted = exact_transition(algorithm, vector)
        apart = [abs(float(PRECISE.mpf(float(x)) - y)) for x, y in zip(row, wanted, strict=True)]
        assert np.all(apart <= allowed)


def test_small_turns_keep_their_digits(rng):
    # Relative to the turn itself, which an absolute bound would not see.
    update = strapgen.evaluator("euler-update")
    for size in (1e-250, 1e-120, 1e-20, 1e-9, 1e-4, 0.3):
        phi = size * rng.uniform(0.5, 1, 3)
        made = update([0.0, 0, 0, 1], phi)
        wanted = exact_transition("euler", phi)
        for x, y in zip(made, wanted, strict=True):
            assert abs(PRECISE.mpf(float(x)) / y - 1) <= 4 * 2.0**-52


def test_the_rotation_of_the_navigation_frame_is_exact_for_a_rate_that_is_linear():
    made = derive("navigation-rotation")
    ring, a, b, T = sp.ring("a b T", sp.QQ)
    turns = {"previous_turn": a * T, "turn": (a + b * T) * T}
    values = {name: turns[s.name] if s.name in turns else ring(0) for s in made.inputs for name in s.elements}
    result = made.expand(values)
    assert result["next_navigation_rotation"] == [a * T + b * T**2 / 2] * 3
    assert result["next_previous_turn"] == [turns["turn"]] * 3


def test_orders_are_told():
    assert "up to degree 5" in derive("dcm-update-5").notes[0]
    assert derive("dcm-update-5").name == "dcm-update-5"
    assert derive("dcm-update").inputs[1].bound == Fraction(1)
