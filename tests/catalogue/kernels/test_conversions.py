"""Conversions: exact round trips on rational quaternions, and SciPy on attitudes that divide badly."""

from fractions import Fraction
from functools import cache
from itertools import product
from random import Random

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from strapgen import derive, lower

EPS = np.finfo(float).eps
FROM_DCM = ("euler-from-dcm", "cayley-klein-from-dcm")


@cache
def kernel(name: str):
    return derive(name)


@cache
def program(name: str):
    return lower(kernel(name))


def convert(name: str, elements) -> list:
    """Return an exact conversion."""
    made = kernel(name)
    (result,) = made.expand(dict(zip(made.inputs[0].elements, elements, strict=True))).values()
    return result


def in_double(name: str, array: np.ndarray) -> np.ndarray:
    made = program(name)
    (result,) = made.run(dict(zip(made.inputs[0].elements, map(float, array.flat), strict=True))).values()
    return np.array(result, float).reshape(made.outputs[0].signal.shape)


def scalar_last(name: str, state):
    """Return what a kernel "...-from-dcm" gives as a quaternion with the scalar last."""
    return state if name == "euler-from-dcm" else [*state[1:], state[0]]


def rational_units() -> st.SearchStrategy[tuple[sp.Rational, ...]]:
    """Return unit quaternions in rationals: the square of any quaternion over its squared length."""

    def squared(q):
        x, y, z, s = map(sp.Integer, q)
        length = x * x + y * y + z * z + s * s
        return (2 * s * x / length, 2 * s * y / length, 2 * s * z / length, (2 * s * s - length) / length)

    return st.tuples(*[st.integers(-9, 9)] * 4).filter(any).map(squared)


@pytest.mark.parametrize("name", FROM_DCM)
def test_the_relation_behind_the_quaternion_is_linear_in_the_matrix(name):
    # 4 e e' from C, on the unit sphere: with the trace t of C, 4 e_i^2 = 1 + 2 C_ii - t, 4 e_s^2 = 1 + t, ...
    ring, x, y, z, s = sp.ring("x y z s", sp.QQ)
    e = {"x": x, "y": y, "z": z, "s": s}
    sphere = x**2 + y**2 + z**2 + s**2 - 1
    made = kernel(name)
    known = dict(zip(made.inputs[0].elements, convert("dcm-from-euler", (x, y, z, s)), strict=True))
    checked = set()
    for stage in made.stages:
        if stage.signal.name == "largest":
            break
        (element,), (expression,) = stage.signal.elements, stage.expressions
        assert sp.Poly(expression, *expression.free_symbols).total_degree() == 1
        known[element] = ring(
            sum((c * known[str(g)] for g, c in linear(expression)), ring(constant(expression)))
        )
        if element.startswith("four_"):
            i, j = element[-2:]
            assert (known[element] - 4 * e[i] * e[j]).rem(sphere) == 0
            checked.add("".join(sorted((i, j))))
    assert checked == {"".join(sorted(pair)) for pair in product("xyzs", repeat=2)}


def linear(expression):
    return [(symbol, sp.diff(expression, symbol)) for symbol in expression.free_symbols]


def constant(expression):
    return expression.subs(dict.fromkeys(expression.free_symbols, 0))


@pytest.mark.parametrize("name", FROM_DCM)
@settings(derandomize=True, database=None, deadline=None, max_examples=25)
@given(unit=rational_units())
def test_round_trips_are_exact(name, unit):
    matrix = convert("dcm-from-euler", unit)
    again = scalar_last(name, convert(name, matrix))
    assert again[3] >= 0
    assert tuple(again) in (unit, tuple(-x for x in unit))


def test_euler_and_cayley_klein_parameters_differ_in_order():
    # a1 = e4, a2 = e1, a3 = e2, a4 = e3
    e1, e2, e3, e4 = e = sp.symbols("e1:5")
    assert convert("cayley-klein-from-euler", e) == [e4, e1, e2, e3]
    assert convert("euler-from-cayley-klein", (e4, e1, e2, e3)) == [e1, e2, e3, e4]


def test_both_states_of_one_rotation_give_one_matrix():
    e = sp.symbols("e1:5")
    matrices = convert("dcm-from-euler", e), convert("dcm-from-cayley-klein", (e[3], *e[:3]))
    assert sp.Matrix(matrices[0]).expand() == sp.Matrix(matrices[1]).expand()


def special_attitudes() -> list[Rotation]:
    """Return attitudes at and around the ends of every branch, by axis and angle."""
    axes = [np.array(axis, float) for axis in product((-1, 0, 1), repeat=3) if any(axis)]
    axes += [np.array(axis) for axis in ((3.0, 2, 1), (1e-8, 1, 1e-9), (1, 1e-4, -1e-12))]
    exact = [0, np.pi / 2, 2 * np.pi / 3, np.pi]
    near = [angle + sign * 10.0**-k for angle in exact for sign in (-1, 1) for k in (3, 6, 9, 12, 15)]
    return [
        Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle)
        for axis in axes
        for angle in [*exact, *near, 1e-8, 1e-160]
    ]


@pytest.mark.parametrize("name", FROM_DCM)
def test_quaternions_of_special_attitudes(name):
    check_against_scipy(name, special_attitudes())


@pytest.mark.parametrize("name", FROM_DCM)
def test_quaternions_of_random_attitudes(name, rng):
    check_against_scipy(name, list(Rotation.random(300, rng=rng)))


def check_against_scipy(name: str, attitudes: list[Rotation]) -> None:
    for attitude in attitudes:
        expected = attitude.as_quat()  # scalar last
        result = np.array(scalar_last(name, in_double(name, attitude.as_matrix())))
        assert result[3] >= 0
        # Each element of 4 e e' is a sum of a few rounded elements of C, divided by a root of at least 1.
        assert min(np.abs(result - expected).max(), np.abs(result + expected).max()) <= 4 * EPS


@pytest.mark.parametrize("name", ["dcm-from-euler", "dcm-from-cayley-klein"])
def test_matrices_are_scipys(name, rng):
    for attitude in [*Rotation.random(100, rng=rng), *special_attitudes()]:
        x, y, z, s = attitude.as_quat()
        state = np.array([x, y, z, s] if name == "dcm-from-euler" else [s, x, y, z])
        assert np.abs(in_double(name, state) - attitude.as_matrix()).max() <= 4 * EPS


def test_a_state_that_is_not_of_length_1_scales_the_matrix():
    unit = (Fraction(1, 5), Fraction(3, 5), Fraction(5, 5), Fraction(1, 5))
    doubled = convert("dcm-from-euler", [2 * x for x in unit])
    assert doubled == [4 * x for x in convert("dcm-from-euler", unit)]


# A rotation in rationals, far from the identity.
TURNED = sp.Matrix([[-8, -1, 4], [4, -4, 7], [1, 8, 4]]) / 9


def parts(computed: sp.Matrix, truth: sp.Matrix) -> dict[str, sp.Matrix]:
    kernel = derive("error-matrix")
    elements = [name for signal in kernel.inputs for name in signal.elements]
    result = kernel.expand(dict(zip(elements, [*computed, *truth], strict=True)))
    return {name: sp.Matrix(3, len(values) // 3, values) for name, values in result.items()}


def test_the_split_is_the_printed_one():
    random = Random(11)
    computed, truth = (sp.Matrix(3, 3, lambda i, j: sp.Rational(random.randint(-99, 99), 7)) for _ in "12")
    result = parts(computed, truth)
    E = computed * truth.T - sp.eye(3)
    assert result["error"] == E
    assert result["scale"] == sp.Matrix([E[0, 0], E[1, 1], E[2, 2]])
    # skew_k = (E_ij + E_ji)/2 with (k, i, j) = (1, 2, 3), (2, 1, 3), (3, 1, 2)
    assert result["skew"] == sp.Matrix([E[1, 2] + E[2, 1], E[0, 2] + E[2, 0], E[0, 1] + E[1, 0]]) / 2
    assert result["drift"] == sp.Matrix([E[1, 2] - E[2, 1], E[2, 0] - E[0, 2], E[0, 1] - E[1, 0]]) / 2


def test_a_small_rotation_is_drift_alone():
    # C_computed = exp(skew(eps)) C, eps in reference axes: drift = -eps, scale and skew of second order.
    t = sp.Symbol("t")
    x, y, z = sp.symbols("x y z", real=True)
    K = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    series = sp.eye(3) + t * K + t**2 * K**2 / 2
    first = {name: part.diff(t).subs(t, 0).expand() for name, part in parts(series * TURNED, TURNED).items()}
    assert first["drift"] == -sp.Matrix([x, y, z])
    assert first["scale"] == first["skew"] == sp.zeros(3, 1)


def test_a_frame_that_lags_has_positive_drift():
    # A turn about z of which a part is lost: the computed angle is the smaller one.
    def about_z(angle):
        return sp.Matrix([[sp.cos(angle), -sp.sin(angle), 0], [sp.sin(angle), sp.cos(angle), 0], [0, 0, 1]])

    lost = sp.Rational(1, 1000)
    drift = parts(about_z(1 - lost), about_z(1))["drift"]
    assert drift[:2, :].applyfunc(sp.simplify) == sp.zeros(2, 1)
    assert float(drift[2]) == pytest.approx(float(sp.sin(lost)), rel=1e-14)
