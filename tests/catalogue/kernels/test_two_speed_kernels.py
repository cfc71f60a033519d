"""Updates by a rotation vector: the cut-off series against Taylor's, the exact form at every angle."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.spatial.transform import Rotation

import strapgen
from strapgen import derive
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.ir.fixed_settings import Settings
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross, cross_elements
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


RING, T, *SYMBOLS = sp.ring(
    "T " + " ".join(f"{v}{k}{axis}" for v in "wabuex" for k in (0, 1) for axis in "xyz"), sp.QQ
)
W0, W1, A0, _, B0, _, U0, _, ETA0, _, _, _ = (SYMBOLS[3 * k : 3 * k + 3] for k in range(12))


class Path:
    """A vector that is a polynomial of the time, by powers."""

    def __init__(self, *powers):
        self.powers = [list(map(RING, power)) for power in powers]

    def integral(self, start):
        raised = [[x / (k + 1) for x in power] for k, power in enumerate(self.powers)]
        return Path(start, *raised)

    def cross(self, other):
        powers = [[RING(0)] * 3 for _ in range(len(self.powers) + len(other.powers) - 1)]
        for j, left in enumerate(self.powers):
            for k, right in enumerate(other.powers):
                powers[j + k] = [
                    a + b for a, b in zip(powers[j + k], cross_elements(left, right), strict=True)
                ]
        return Path(*powers)

    def __add__(self, other):
        size = max(len(self.powers), len(other.powers))
        zero = [RING(0)] * 3
        padded = [p.powers + [zero] * (size - len(p.powers)) for p in (self, other)]
        return Path(*([a + b for a, b in zip(x, y, strict=True)] for x, y in zip(*padded, strict=True)))

    def at(self, time):
        return [sum((power[k] * time**n for n, power in enumerate(self.powers)), RING(0)) for k in range(3)]


def given(kernel, **vectors):
    """Return what a kernel makes of vectors by the names of its inputs; others are zero."""
    values = {}
    for signal in kernel.inputs:
        vector = vectors.pop(signal.name, [RING(0)] * 3)
        values |= dict(zip(signal.elements, vector, strict=True))
    assert not vectors
    return {name: list(map(RING, result)) for name, result in kernel.expand(values).items()}


def test_the_coning_recursion_is_exact_for_a_constant_rate_and_a_ramp():
    # (26) from (22) and (25): the integral of beta x w / 2 over a cycle from 0 to T, the one before from -T to 0.
    rate = Path(W0, W1)
    angle = rate.integral([0, 0, 0])
    increment, previous = angle.at(T), [-x for x in angle.at(-T)]
    beta = rate.integral(B0)
    wanted = beta.cross(rate).integral([0, 0, 0]).at(T)
    made = given(
        derive("coning-fast"), angle_sum=B0, coning=ETA0, previous_increment=previous, increment=increment
    )
    assert made["next_coning"] == [e + w / 2 for e, w in zip(ETA0, wanted, strict=True)]
    assert made["next_angle_sum"] == beta.at(T)
    assert made["next_previous_increment"] == increment


@pytest.mark.parametrize("form", [1, 2])
def test_the_sculling_recursions_are_exact_for_constant_rate_and_force(form):
    rate, force = Path(W0), Path(A0)
    beta, u = rate.integral(B0), force.integral(U0)
    moved = beta.cross(force)  # (50)
    factor = 1
    if form == 2:
        moved, factor = moved + u.cross(rate), 2
    wanted = [e + x / factor for e, x in zip(ETA0, moved.integral([0, 0, 0]).at(T), strict=True)]
    made = given(
        derive(f"sculling-fast-{form}"),
        angle_sum=B0,
        velocity_sum=U0,
        sculling=ETA0,
        increment=Path(W0).integral([0, 0, 0]).at(T),
        velocity_increment=Path(A0).integral([0, 0, 0]).at(T),
    )
    assert made["next_sculling"] == wanted
    assert made["next_velocity_sum"] == u.at(T)


def test_both_sculling_integrals_give_one_velocity():
    # (49): S1 = S2 + beta x u / 2, held by the recursions from cycle to cycle, whatever the increments are.
    start = {"angle_sum": B0, "velocity_sum": U0, "increment": W0, "velocity_increment": A0}
    second = given(derive("sculling-fast-2"), sculling=ETA0, **start)
    first_start = [e + c / 2 for e, c in zip(ETA0, cross_elements(B0, U0), strict=True)]
    first = given(derive("sculling-fast-1"), sculling=first_start, **start)
    added = cross_elements(second["next_angle_sum"], second["next_velocity_sum"])
    assert first["next_sculling"] == [s + c / 2 for s, c in zip(second["next_sculling"], added, strict=True)]


@pytest.mark.parametrize("name", ["coning-fast", "sculling-fast-1", "sculling-fast-2"])
def test_states_are_handed_on(name):
    kernel = derive(name)
    inputs = {signal.name: signal for signal in kernel.inputs}
    outputs = {stage.signal.name: stage.signal for stage in kernel.outputs}
    assert list(kernel.recursion.inputs) == list(outputs)
    for output, held in kernel.recursion.inputs.items():
        assert outputs[output].shape == inputs[held].shape and outputs[output].unit == inputs[held].unit
    samples = inputs.keys() - set(kernel.recursion.inputs.values())
    coning = name == "coning-fast"
    assert samples == ({"increment"} if coning else {"increment", "velocity_increment"})
    assert kernel.recursion.retained == (("previous_increment",) if coning else ())


# Drift, by running the recursions

FREQUENCY, FAST, SLOW, TURNS = 7.0, 0.01, 0.1, 10


def oscillation(amplitude, phase, cycles):
    """Return increments of amplitude sin(2 pi f t + phase), from one cycle before the start."""
    times = FAST * np.arange(-1, TURNS * cycles + 1)
    return np.diff(amplitude * np.sin(2 * np.pi * FREQUENCY * times + phase))


def run(loop, samples, kept, slow_cycles):
    """Run a fast loop from numpy's increments, and return its states at the end of every slow cycle."""
    recursion = derive(loop.sources.kernel).recursion
    names = [signal.name for signal in loop.function.inputs]
    outputs = [signal.name for signal in loop.function.outputs]
    state = {name: np.zeros(3) for name, _ in recursion.states} | kept
    ends = []
    for cycle in range(slow_cycles):
        state = state | {name: np.zeros(3) for name in recursion.reset}
        for k in range(TURNS):
            now = {name: values[cycle * TURNS + k] for name, values in samples.items()}
            result = loop(*(state[name] if name in state else now[name] for name in names))
            state = {
                recursion.inputs[name]: np.asarray(value, float)
                for name, value in zip(outputs, result, strict=True)
            }
        ends.append(state)
    return ends


def tolerance(loop, output, exact_to):
    """Return what a slow cycle may be off by: certified in fixed point, with the rounding of the increments."""
    if hasattr(loop, "interface"):
        (argument,) = [a for a in loop.interface.outputs if a.signal.name == output]
        return TURNS * (float(max(argument.errors)) + 2.0 * float(argument.format.unit))
    return exact_to if loop.dtype == np.float64 else 1e4 * exact_to


def test_coning_drift_is_that_of_the_source(backend_name):
    # Checked independently by the project's transcription of the source: -2.720926166e-3 rad/s in every slow cycle.
    loop = strapgen.evaluator("coning-fast", backend_name)
    x, y = oscillation(0.01, 0, 3), oscillation(0.013, 0.9, 3)
    increments = np.stack([x, y, 0 * x], axis=-1)
    ends = run(loop, {"increment": increments[1:]}, {"previous_increment": increments[0]}, 3)
    for end in ends:
        off = abs(end["coning"][2] - SLOW * -2.720926166e-3)
        assert off <= tolerance(loop, "next_coning", SLOW * 1e-10 * 5e-3)
        if not BACKENDS[backend_name].fixed:
            assert np.abs(end["coning"][:2]).max() == 0


def test_sculling_rate_is_that_of_the_source(backend_name):
    # 1.1042645359e-2 m/s^2 in every slow cycle; the integral of D sin is D (1 - cos)/(2 pi f).
    loop = strapgen.evaluator("sculling-fast-2", backend_name)
    x = oscillation(0.01, 0, 3)
    y = -oscillation(3 / (2 * np.pi * FREQUENCY), 0.9 + np.pi / 2, 3)
    samples = {
        "increment": np.stack([x, 0 * x, 0 * x], axis=-1)[1:],
        "velocity_increment": np.stack([0 * y, y, 0 * y], axis=-1)[1:],
    }
    for end in run(loop, samples, {}, 3):
        off = abs(end["sculling"][2] - SLOW * 1.1042645359e-2)
        assert off <= tolerance(loop, "next_sculling", SLOW * 1e-10 * 2e-2)


def test_rotation_compensation_comes_out_of_the_product_rule():
    # (48) to (49): with beta' = w and u' = a, beta x a is half the derivative of beta x u and half of beta x a + u x w.
    t = sp.Symbol("t")
    beta, u = (sp.Matrix([sp.Function(f"{name}{axis}")(t) for axis in "xyz"]) for name in "bu")
    w, a = beta.diff(t), u.diff(t)
    split = cross(beta, u).diff(t) / 2 + (cross(beta, a) + cross(u, w)) / 2
    assert (cross(beta, a) - split).expand() == sp.zeros(3, 1)


def test_to_first_order_the_body_has_turned_by_its_increments():
    # (46) and (47): C(m) A(t) with A = I + (beta x), the first order of the update.
    made = derive("dcm-update-1").expand(
        {**dict(zip(derive("dcm-update-1").inputs[0].elements, sp.eye(3), strict=True)), **symbols("phi")}
    )
    x, y, z = symbols("phi").values()
    assert made["next"] == [1, -z, y, z, 1, -x, -y, x, 1]


def symbols(prefix):
    return {f"{prefix}_{axis}": sp.Symbol(f"{prefix}_{axis}", real=True) for axis in "xyz"}


@pytest.mark.parametrize("form", [1, 2])
def test_the_velocity_is_that_of_the_equation(form, rng):
    C = Rotation.random(rng=rng).as_matrix()
    u, s, beta = rng.normal(size=(3, 3))
    given = (C, u, s, beta)[: 2 + form]
    wanted = C @ (u + s + (np.cross(beta, u) / 2 if form == 2 else 0))
    np.testing.assert_allclose(strapgen.evaluator(f"dcm-velocity-{form}")(*given), wanted, atol=2e-15)


@pytest.mark.parametrize("what", ["acceleration", "velocity-1", "velocity-2"])
def test_euler_parameters_agree_with_the_matrix(what):
    # As polynomials, on the unit sphere: the matrix of a quaternion is that of dcm-from-euler.
    by_matrix, by_parameters = derive(f"dcm-{what}"), derive(f"euler-{what}")
    names = [name for signal in by_parameters.inputs for name in signal.elements]
    generators = sp.ring(names, sp.QQ)[1:]
    values = dict(zip(names, generators, strict=True))
    state = by_parameters.inputs[0].elements
    (matrix,) = derive("dcm-from-euler").expand({n: values[n] for n in state}).values()
    held = {n: v for n, v in values.items() if n not in state}
    wanted = by_matrix.expand(dict(zip(by_matrix.inputs[0].elements, matrix, strict=True)) | held)
    assert by_parameters.expand(values) == wanted


def test_the_frame_correction_is_half_a_cross_product():
    (made,) = derive("navigation-velocity").expand().values()
    theta, v = (sp.Matrix(list(symbols(p).values())) for p in ("theta", "v"))
    assert (sp.Matrix(made) + cross(theta, v) / 2).expand() == sp.zeros(3, 1)
