"""Runge-Kutta steps: the fused kernels are the staged formulas of the thesis (chapter 3 A and B), exactly."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from random import Random

import numpy as np
import pytest
import sympy as sp

from strapgen import derive
from strapgen.catalogue import ALGORITHMS, STANDARD_METHODS
from strapgen.catalogue.kernels.attitude_step import step
from strapgen.catalogue.kinematics import KINEMATICS
from strapgen.catalogue.methods.method import increments_signal
from strapgen.catalogue.methods.runge_kutta import _NODES, _WEIGHTS, method
from strapgen.catalogue.methods.tableaux import TABLEAUX

ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS)
METHOD = pytest.mark.parametrize("method", STANDARD_METHODS)

# The rate times the step at the beginning, the middle and the end, from the increments oldest first. For two
# increments as printed; for three from the differences of a cubic, f'(0) = (-11 f0 + 18 f1 - 9 f2 + 2 f3)/6 and
# f'(3/2) = (f0 - 27 f1 + 27 f2 - f3)/24 at unit distance.
EXTRACTION = {
    1: {"begin": (1,), "middle": (1,), "end": (1,)},
    2: {"begin": (3, -1), "middle": (1, 1), "end": (-1, 3)},
    3: {
        "begin": (Fraction(11, 2), Fraction(-7, 2), 1),
        "middle": (Fraction(-1, 8), Fraction(13, 4), Fraction(-1, 8)),
        "end": (1, Fraction(-7, 2), Fraction(11, 2)),
    },
}


def derivative(algorithm: str, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return f(x, w) of chapter 2; elements are numbers or polynomials."""
    wx, wy, wz = w
    if algorithm == "dcm":
        return x @ np.array([[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]], dtype=object)
    if algorithm == "euler":
        matrix = [[0, wz, -wy, wx], [-wz, 0, wx, wy], [wy, -wx, 0, wz], [-wx, -wy, -wz, 0]]
    else:
        matrix = [[0, -wx, -wy, -wz], [wx, 0, wz, -wy], [wy, -wz, 0, wx], [wz, wy, -wx, 0]]
    return np.array(matrix, dtype=object) @ x * Fraction(1, 2)


def staged(algorithm: str, method: str, x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return one step as the formulas stand; f is linear in w, so h f(x, w) = f(x, h w)."""
    weights = EXTRACTION[len(d)]
    begin, middle, end = (
        sum(Fraction(c) * row for c, row in zip(weights[node], d, strict=True))
        for node in ("begin", "middle", "end")
    )

    def f(x, w):
        return derivative(algorithm, x, w)

    half, third, sixth = Fraction(1, 2), Fraction(1, 3), Fraction(1, 6)
    if method == "rk1":
        return x + f(x, begin)
    if method == "rk2":
        y = x + f(x, begin)
        return x + (f(y, end) + f(x, begin)) * half
    A = f(x, begin)
    B = f(x + A * half, middle)
    if method == "rk3":  # Kutta
        C = f(x - A + B * 2, end)
        return x + (A + B * 4 + C) * sixth
    C = f(x + B * half, middle)
    D = f(x + C, end)
    return x + A * sixth + B * third + C * third + D * sixth


def shape(algorithm: str) -> tuple[int, ...]:
    return (3, 3) if algorithm == "dcm" else (4,)


@cache
def kernel(algorithm: str, method: str, increments: int = 2):
    return derive(algorithm, method, increments)


@cache
def polynomials(algorithm: str, method: str, increments: int = 2) -> list:
    return kernel(algorithm, method, increments).polynomials()["next"]


def split(algorithm: str, generators: list, increments: int) -> tuple[np.ndarray, np.ndarray]:
    size = 9 if algorithm == "dcm" else 4
    state = np.array(generators[:size], dtype=object).reshape(shape(algorithm))
    return state, np.array(generators[size:], dtype=object).reshape(increments, 3)


@ALGORITHM
@METHOD
def test_the_kernel_is_the_staged_step_on_any_state(algorithm, method):
    result = polynomials(algorithm, method)
    x, d = split(algorithm, list(result[0].ring.gens), 2)
    assert list(staged(algorithm, method, x, d).flat) == result


@pytest.mark.parametrize("increments", [1, 3])
@ALGORITHM
@METHOD
def test_other_counts_of_increments(algorithm, method, increments):
    step, random = kernel(algorithm, method, increments), Random(1969)
    names = [name for signal in step.inputs for name in signal.elements]
    for _ in range(3):
        # A polynomial identity that fails holds on three random points of this size next to never.
        values = [Fraction(random.randint(-99, 99), random.randint(1, 99)) for _ in names]
        x, d = split(algorithm, values, increments)
        result = step.expand(dict(zip(names, values, strict=True)))["next"]
        expected = staged(algorithm, method, x, d).flat
        assert [Fraction(int(r.p), int(r.q)) for r in map(sp.Rational, result)] == list(expected)


@ALGORITHM
@METHOD
def test_the_step_is_the_product_with_the_step_of_the_identity(algorithm, method):
    step, result = kernel(algorithm, method), polynomials(algorithm, method)
    ring = result[0].ring
    x, d = split(algorithm, list(ring.gens), 2)
    identity = step.attitude_step.identity
    names = [name for signal in step.inputs for name in signal.elements]
    transition = step.expand(dict(zip(names, [*map(ring, identity), *d.flat], strict=True)))["next"]
    product = derive(step.attitude_step.product)
    elements = [name for signal in product.inputs for name in signal.elements]
    assert product.expand(dict(zip(elements, [*x.flat, *transition], strict=True)))["next"] == result


@ALGORITHM
@METHOD
def test_a_step_from_rates_is_the_step_from_increments_after_rate_extraction(algorithm, method):
    from_rates = derive(algorithm, method, rates=True)
    state, turns = from_rates.inputs
    from_increments = derive(algorithm, method, 2)
    names = [*state.elements, *increments_signal(2).elements]
    ring, *generators = sp.ring(names, sp.QQ)
    values = dict(zip(names, generators, strict=True))
    d = np.array(generators[state.size :], dtype=object).reshape(2, 3)
    node = {"0": "begin", "1_2": "middle", "1": "end"}
    for row in range(turns.shape[0]):
        elements = turns.elements[3 * row : 3 * row + 3]
        weights = EXTRACTION[2][node[elements[0].removeprefix("turn_").removesuffix("_x")]]
        turn = sum(c * x for c, x in zip(weights, d, strict=True))
        values |= dict(zip(elements, turn, strict=True))
    given = from_rates.expand({name: values[name] for name in (*state.elements, *turns.elements)})
    expected = from_increments.polynomials()
    assert [ring(x) for x in given["next"]] == expected["next"]


@pytest.mark.long
@pytest.mark.parametrize("increments", [None, 3])
def test_irrational_coefficients_stay_exact_and_their_nodes_have_names(increments):
    tableau = TABLEAUX["cooper-verner8"]
    kernel = step(KINEMATICS["euler"], method(tableau), increments)
    names = [signal.name for signal in (*kernel.inputs, *(stage.signal for stage in kernel.stages))]
    elements = [n for s in (*kernel.inputs, *(stage.signal for stage in kernel.stages)) for n in s.elements]
    assert all(name.isidentifier() for name in names + elements)
    assert len(set(elements)) == len(elements)
    assert ("turn_0_1727_x" if increments is None else "half_turn_0_1727_x") in elements
    assert not any(e.has(sp.Float) for stage in kernel.stages for e in stage.expressions)
    assert any(e.has(sp.sqrt(21)) for stage in kernel.stages for e in stage.expressions)


@pytest.mark.long
def test_a_step_with_irrational_coefficients_has_its_order():
    # A constant rate about one axis: cos + i sin of half the angle, up to the eighth power.
    x = sp.Symbol("x")
    kernel = step(KINEMATICS["euler"], method(TABLEAUX["cooper-verner8"]), 1)
    state, increments = kernel.inputs
    values = dict(zip(state.elements, kernel.attitude_step.identity, strict=True))
    values |= dict(zip(increments.elements, (x, sp.Integer(0), sp.Integer(0)), strict=True))
    result = [sp.expand(element) for element in kernel.expand(values)["next"]]
    exponential = sum((sp.I * x / 2) ** k / sp.factorial(k) for k in range(9))
    difference = sp.expand(result[3] + sp.I * result[0] - exponential)
    assert all(sp.Poly(difference, x).coeff_monomial(x**k) == 0 for k in range(9))
    assert result[1] == result[2] == 0


def test_the_coefficients_meet_the_conditions_of_third_order_in_time():
    for power in range(3):
        total = sum((w * c**power for w, c in zip(_WEIGHTS, _NODES, strict=True)), Fraction(0))
        assert total == Fraction(1, power + 1)


def test_the_coefficients_meet_the_condition_of_the_order_of_the_exponentials():
    """The commutators of the product are those of the Magnus series: sum_(i<j) b_i b_j (c_j - c_i) is 1/6."""
    nodes = range(len(_NODES))
    total = sum(
        (_WEIGHTS[i] * _WEIGHTS[j] * (_NODES[j] - _NODES[i]) for i in nodes for j in nodes if i < j),
        Fraction(0),
    )
    assert total == Fraction(1, 6)
