"""Updates by a rotation vector: the cut-off series against Taylor's, the exact form at every angle."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import derive
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.ir.fixed_settings import Settings
from strapgen.kernel import algebra
from strapgen.run.backends import BACKENDS

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


@pytest.mark.parametrize("order", [1, 2])
def test_the_navigation_frame_is_the_sources(order):
    # (6): B = I - (theta x) + (theta x)^2 / 2. (15): r = (-theta/2, 1 - (theta/2)^2 / 2). First order has no squares.
    theta = sp.Matrix(sp.symbols("theta_x theta_y theta_z", real=True))
    made = derive(f"dcm-navigation-update-{order}")
    C = sp.Matrix(3, 3, [sp.Symbol(n, real=True) for n in made.inputs[0].elements])
    K = algebra.skew(theta)
    wanted = (sp.eye(3) - K + (order - 1) * K * K / 2) * C
    assert (sp.Matrix(3, 3, made.expand()["next"]) - wanted).expand() == sp.zeros(3, 3)
    made = derive(f"euler-navigation-update-{order}")
    q = sp.Matrix([sp.Symbol(n, real=True) for n in made.inputs[0].elements])
    r = sp.Matrix([*(-theta / 2), 1 - (order - 1) * algebra.dot(theta, theta) / 8])
    wanted = algebra.quaternion_product(r, q)
    assert (sp.Matrix(made.expand()["next"]) - wanted).expand() == sp.zeros(4, 1)


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


#: Angles around every switch: no angle, squares that vanish, and all sizes up to the bound of the kernel's formats.
SIZES = (0.0, 5e-324, 1e-200, 1e-154, 1e-30, 1e-16, 1.5e-8, 3e-5, 1e-3, 0.0625, 0.5, 0.999)


DIRECTIONS = np.array([[1, 0, 0], [0, -1, 0], [0.6, 0, 0.8], [2 / 3, -1 / 3, 2 / 3]])


def check_exact(update, algorithm: str, phi: np.ndarray, fixed: bool) -> None:
    """Compare the rotation by each vector with that of many digits."""
    identity = np.array(KINEMATICS[algorithm].identity, float).squeeze()
    if fixed:
        (state, given), (result,) = update.interface.inputs, update.interface.outputs
        phi = update.numbers(given, update.integers(given, phi))
        identity = update.numbers(state, update.integers(state, identity))
        allowed = np.tile([float(error) for error in result.errors], (len(phi), 1))
    else:
        phi = phi.astype(update.dtype).astype(float)
        # Sums and products of numbers up to 1, and twice what rounding makes of the angle: the square and its root.
        size = np.linalg.norm(phi, axis=-1, keepdims=True)
        allowed = (4 + 2 * np.where(size > 1, size, 0)) * np.finfo(update.dtype).eps
        allowed = np.broadcast_to(allowed, (len(phi), identity.size))
    made = update(identity.astype(update.dtype), phi.astype(update.dtype)).reshape(len(phi), -1)
    for row, vector, bound in zip(made, phi, allowed, strict=True):
        wanted = exact_transition(algorithm, vector)
        apart = [abs(float(PRECISE.mpf(float(x)) - y)) for x, y in zip(row, wanted, strict=True)]
        assert np.all(apart <= bound)


def test_the_exact_form_needs_no_switch(algorithm, backend_name):
    # sin(x)/x is as good near 0 as elsewhere; only at 0 it must be 1. In fixed point a polynomial of the square takes
    # its place, and the bound is certified.
    update = strapgen.evaluator(f"{algorithm}-update", backend_name)
    phi = np.concatenate([size * DIRECTIONS for size in SIZES])
    check_exact(update, algorithm, phi, BACKENDS[backend_name].fixed)


#: Up to half a turn, on the spot and beyond, to a whole one and beyond.
LARGE = (1.5, 3.0, np.pi - 1e-9, np.pi, np.pi + 1e-9, 4.0, 2 * np.pi - 1e-9, 2 * np.pi, 7.0)


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_the_exact_form_holds_to_a_whole_turn(algorithm, backend):
    phi = np.concatenate([size * DIRECTIONS for size in LARGE])
    check_exact(strapgen.evaluator(f"{algorithm}-update", backend), algorithm, phi, fixed=False)


@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_the_exact_form_holds_beyond_half_a_turn_in_fixed_point(algorithm):
    # Elements of up to 3 rad: their angle goes to 5.19 rad.
    update = strapgen.evaluator(
        f"{algorithm}-update", "c-fixed32", Settings(ranges={"rotation_vector": Fraction(3)})
    )
    directions = np.vstack([DIRECTIONS, np.array([1, -1, 1]) / np.sqrt(3)])
    phi = np.concatenate([size * directions for size in (*SIZES, *LARGE, 5.19)])
    phi = phi[np.abs(phi).max(axis=-1) <= 3]
    assert np.linalg.norm(phi, axis=-1).max() > 5
    check_exact(update, algorithm, phi, fixed=True)


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


# What the source says of the size of the rotation, and of orthonormalization
