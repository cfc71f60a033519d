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
EPS = 2.0**-52


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


@pytest.mark.long
@pytest.mark.parametrize("order", ["", "-1", "-2"])
def test_a_turn_of_both_frames_leaves_the_attitude(algorithm, order, rng):
    # A body at the reference attitude that turns with the navigation frame stays there, but for what is cut off:
    # (I + K)(I - K) = I - K^2 and (I + K + K^2/2)(I - K + K^2/2) = I + K^4/4, K^2 = theta theta' - |theta|^2 and
    # K^4 = -|theta|^2 K^2; with quaternions theta/2 stands for K, and its square is -|theta|^2/4.
    identity = np.array(KINEMATICS[algorithm].identity, float).squeeze()
    theta = rng.uniform(-1e-3, 1e-3, (20, 3))
    turned = strapgen.evaluator(f"{algorithm}-update{order}")(identity, theta)
    back = strapgen.evaluator(f"{algorithm}-navigation-update{order}")(turned, theta)
    square = (theta**2).sum(axis=-1)
    if algorithm == "dcm":
        squares = theta[:, :, None] * theta[:, None, :] - square[:, None, None] * identity
        left = {"": 0 * squares, "-1": -squares, "-2": -square[:, None, None] * squares / 4}[order]
    else:
        left = {"": 0 * square, "-1": square / 4, "-2": square**2 / 64}[order][:, None] * identity
    # Transitions next to the identity are rounded once each, their product once for each of two terms near 1 or less.
    assert np.abs(back - identity - left).max() <= 2 * EPS


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


def test_orders_are_told():
    assert "up to degree 5" in derive("dcm-update-5").notes[0]
    assert derive("dcm-update-5").name == "dcm-update-5"
    assert derive("dcm-update").inputs[1].bound == Fraction(1)


# What the source says of the size of the rotation, and of orthonormalization


@pytest.mark.long
@pytest.mark.parametrize("order", range(1, 6))
@pytest.mark.parametrize("name", ["dcm", "euler"])
def test_what_is_cut_off_at_a_tenth_of_a_radian(name, order):
    # The leading term from the series of sine and cosine beside what the kernel leaves. Of each further term of the
    # series elements are no larger than the power over the factorial: of angle^(order + 2) and less, together.
    x = sp.Symbol("x", positive=True)
    axis = sp.Matrix([2, -1, 2]) / 3
    update = derive(f"{name}-update-{order}")
    identity = list(KINEMATICS[name].identity)
    values = dict(zip(update.inputs[0].elements, identity, strict=True))
    values |= dict(zip(update.inputs[1].elements, x * axis, strict=True))
    made = [sp.expand(c) for c in update.expand(values)["next"]]
    if name == "dcm":
        K = algebra.skew(axis)
        whole = list(sp.eye(3) + sp.sin(x) * K + (1 - sp.cos(x)) * K * K)
    else:
        whole = [*(sp.sin(x / 2) * axis), sp.cos(x / 2)]
    left = [sp.series(c, x, 0, order + 2).removeO() - m for c, m in zip(whole, made, strict=True)]
    leading = [sp.expand(c).coeff(x, order + 1) for c in left]
    assert [sp.expand(c - y * x ** (order + 1)) for c, y in zip(left, leading, strict=True)] == [0] * len(
        left
    )
    half = 1 if name == "dcm" else 2
    size = sp.Rational(1, half ** (order + 1) * sp.factorial(order + 1))
    assert 0 < max(abs(c) for c in leading) <= size
    angle = 0.1
    phi = angle * np.array([2, -1, 2]) / 3
    found = strapgen.evaluator(update.name)(
        np.array(identity, float).reshape(update.inputs[0].shape), phi
    ).ravel()
    error = np.array(
        [float(y - PRECISE.mpf(float(c))) for y, c in zip(exact_transition(name, phi), found, strict=True)]
    )
    rest = 1.1 * (angle / half) ** (order + 2) / float(sp.factorial(order + 2))
    assert np.abs(error - np.array(leading, float) * angle ** (order + 1)).max() <= rest + 2 * EPS
    # What order three leaves of a tenth of a radian is below 5e-6, fifth order below 2e-9: the limit of the source.
    assert np.abs(error).max() <= {1: 5e-3, 2: 2e-4, 3: 5e-6, 4: 1e-7, 5: 2e-9}[order]


def stepped(update, state: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Return a state after many calls of the generated C, one after the other."""
    given, interface = [state, phi], getattr(update, "interface", None)
    if interface is not None:
        arguments = zip(interface.inputs, given, strict=True)
        given = [update.integers(*pair).astype(update.word_type) for pair in arguments]
    before, vectors = map(np.ascontiguousarray, given)
    buffers = [update.pointer(array) for array in (before, np.empty_like(before))]
    function, first = getattr(update.module.lib, update.function.name), update.pointer(vectors)
    for k in range(len(phi)):
        assert not function(buffers[k % 2], first + 3 * k, buffers[1 - k % 2])
    assert len(phi) % 2 == 0
    return before if interface is None else update.numbers(interface.outputs[0], before)


@pytest.mark.long
@pytest.mark.parametrize("backend", ["c", "c-fixed32"])
@pytest.mark.parametrize("name", ["dcm", "euler"])
def test_exact_updates_need_no_orthonormalization(name, backend, rng):
    # C'C - I, or the square of the length less 1, is turned by a step and not stretched: what steps add is summed.
    # A step moves an element by what is certified, or by 8 units of round-off; C'C - I takes three elements of a
    # column times those of another twice, the square of the length four elements, whose sum is at most 2, twice.
    steps = 100_000
    update = strapgen.evaluator(f"{name}-update", backend)
    state = np.array(KINEMATICS[name].identity, float).squeeze()
    state = stepped(update, state, rng.uniform(-0.1, 0.1, (steps, 3)))
    left = np.abs(state.T @ state - (np.eye(3) if name == "dcm" else 1)).max()
    interface = getattr(update, "interface", None)
    error = 8 * EPS if interface is None else max(map(float, interface.outputs[0].errors))
    a_step = 2 * (3 if name == "dcm" else 2) * error
    assert left <= a_step * steps
    # Rounding to the nearest has no preferred side, so what is left grows with the root of the steps: five times the
    # deviation of such a walk, which is less than a quarter of the bound of a step.
    assert left <= 5 * a_step / 4 * np.sqrt(steps)
    # And it does turn: the attitude is far from where it began.
    assert np.abs(state - np.array(KINEMATICS[name].identity, float).squeeze()).max() > 0.1
