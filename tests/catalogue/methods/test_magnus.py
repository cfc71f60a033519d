"""Magnus series: their order on any rate, the published coning correction, and that a step is a rotation."""

from __future__ import annotations

from random import Random

import mpmath
import numpy as np
import pytest
import sympy as sp
from derived import precisely
from peano_baker import (
    evaluated,
    generic_rate,
    increments,
    local_error,
    lowest_difference,
    true_rotation,
    turns,
)

from strapgen import derive
from strapgen.catalogue import ALGORITHMS
from strapgen.catalogue.methods import magnus
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, evaluate_stages

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long

ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS)
ORDER = pytest.mark.parametrize("order", [2, 4, 6])
#: Methods whose transition is the exponential of a rotation vector.
EXPONENTIAL = pytest.mark.parametrize("method", ["magnus2", "magnus4", "magnus6", "munthe-kaas4"])


def rotation_vector(kernel: Kernel) -> list:
    """Return the rotation vector of a step as polynomials in the elements of its increments, and these."""
    names = kernel.inputs[1].elements
    ring, *generators = sp.ring(names, sp.QQ)
    place = next(k for k, stage in enumerate(kernel.stages) if stage.signal.name == "phi")
    known = evaluate_stages(kernel.stages[: place + 1], dict(zip(names, generators, strict=True)))
    vectors = np.array(generators, object).reshape(-1, 3)
    return [ring(known[f"phi_{axis}"]) for axis in "xyz"], vectors


@pytest.mark.parametrize(("count", "previous"), [(4, 0), (5, 0), (3, 2)])
@ORDER
@ALGORITHM
def test_the_local_error_is_one_order_above_the_series(algorithm, order, count, previous):
    kernel = derive(algorithm, f"magnus{order}", count, previous=previous)
    assert kernel.order.step == order
    assert local_error(kernel, generic_rate(count + previous + 1), order + 2) == order + 1


@pytest.mark.parametrize(("count", "previous"), [(1, 0), (2, 0), (3, 0), (1, 1), (1, 2), (2, 1)])
@ALGORITHM
def test_samples_limit_the_order_where_the_series_does_not(algorithm, count, previous):
    kernel = derive(algorithm, "magnus6", count, previous=previous)
    order = kernel.order.step
    assert order < 6
    assert local_error(kernel, generic_rate(count + previous + 1), order + 2) == order + 1


@ORDER
@ALGORITHM
def test_rates_at_the_nodes_of_gauss_give_the_order_too(algorithm, order):
    # In the field of the nodes' roots, so that the series stay exact.
    root = {2: 1, 4: sp.sqrt(3), 6: sp.sqrt(15)}[order]
    field = sp.QQ if root == 1 else sp.QQ.algebraic_field(root)
    kernel = derive(algorithm, f"magnus{order}", rates=True)
    assert kernel.order.extraction is None and kernel.order.step == order
    rate, top = generic_rate(order + 1, field), order + 1
    nodes = [field.from_sympy(sp.sympify(node)) for node in magnus.method(order).nodes]
    values = dict(zip(kernel.inputs[1].elements, turns(rate, nodes, top), strict=True))
    found = evaluated(kernel, values, kernel.transition, field)
    assert lowest_difference(found, true_rotation(algorithm, rate, top)) == top


@pytest.mark.parametrize(("order", "left"), [(4, 2), (6, 2)])
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_commutators_of_the_other_sign_lose_the_order(algorithm, order, left, monkeypatch):
    monkeypatch.setattr(magnus, "_commutator", algebra.cross)
    kernel = derive(algorithm, f"magnus{order}", 4)
    assert local_error(kernel, generic_rate(5), order + 1) == left + 1


def test_the_published_coning_correction_of_two_increments():
    # J. W. Jordan, NASA TN D-5384 (1969); R. B. Miller, J. Guid. Control Dyn. 6 (1983) 287: 2/3 of the cross product.
    found, (d1, d2) = rotation_vector(derive("euler", "magnus4", 2))
    cross = algebra.cross_elements(list(d1), list(d2))
    assert found == [a + b + sp.Rational(2, 3) * c for a, b, c in zip(d1, d2, cross, strict=True)]


def test_the_published_coning_correction_with_one_previous_increment():
    # 1/12 of the previous increment times the present one: the two-sample algorithm of a slow gyro (Jordan 1969).
    found, (past, d) = rotation_vector(derive("euler", "magnus4", 1, previous=1))
    cross = algebra.cross_elements(list(past), list(d))
    assert found == [a + sp.Rational(1, 12) * c for a, c in zip(d, cross, strict=True)]


@pytest.mark.parametrize(("count", "previous"), [(1, 0), (3, 0), (8, 0), (2, 2)])
@ORDER
def test_at_a_constant_rate_the_rotation_vector_is_the_sum_of_the_increments(order, count, previous):
    kernel = derive("dcm", f"magnus{order}", count, previous=previous)
    ring, *w = sp.ring("x y z", sp.QQ)
    names = kernel.inputs[1].elements
    known = evaluate_stages(
        kernel.stages[:-1],
        dict(zip(names, [x * sp.QQ(1, count) for x in w] * (count + previous), strict=True)),
    )
    vector = (
        "phi" if order > 2 else "d1" if len(names) == 3 else "moment_0"
    )  # an increment itself gets no new name
    assert [ring(known[f"{vector}_{axis}"]) for axis in "xyz"] == w


# The transition is a rotation


def precise_transition(kernel: Kernel, values: dict[str, mpmath.mpf]) -> mpmath.matrix:
    state = dict.fromkeys(kernel.inputs[0].elements, mpmath.mpf(0))
    known, signal = precisely(kernel, state | values), kernel.stages[-1].signal
    flat = [known[name] for name in signal.elements]
    return mpmath.matrix([flat[k : k + 3] for k in (0, 3, 6)] if signal.shape == (3, 3) else flat)


@EXPONENTIAL
@ALGORITHM
def test_a_transition_is_a_rotation_whatever_the_increments_are(algorithm, method):
    kernel, random = derive(algorithm, method, 3, previous=1), Random(1969)
    with mpmath.workdps(60):
        for size in (1, 10**-4, 5):
            values = {
                n: mpmath.mpf(random.randint(-999, 999)) * size / 1000 for n in kernel.inputs[1].elements
            }
            turn = precise_transition(kernel, values)
            product = turn.T * turn
            unit = mpmath.eye(product.rows)
            assert mpmath.mnorm(product - unit) < mpmath.mpf(10) ** -50
            if algorithm == "dcm":
                assert abs(mpmath.det(turn) - 1) < mpmath.mpf(10) ** -50


@EXPONENTIAL
def test_direction_cosines_and_euler_parameters_turn_alike(method):
    # Not only to the order of the method: in every power, since both are exponentials of the same vector.
    top, rate = 9, generic_rate(4)
    found = {}
    for algorithm in ("dcm", "euler"):
        kernel = derive(algorithm, method, 2, previous=1)
        values = dict(zip(kernel.inputs[1].elements, increments(rate, 2, 1, top), strict=True))
        found[algorithm] = evaluated(kernel, values, kernel.transition)
    x, y, z, s = found["euler"]
    matrix = [
        *(s * s + x * x - y * y - z * z, (x * y - s * z) * 2, (x * z + s * y) * 2),
        *((x * y + s * z) * 2, s * s - x * x + y * y - z * z, (y * z - s * x) * 2),
        *((x * z - s * y) * 2, (y * z + s * x) * 2, s * s - x * x - y * y + z * z),
    ]
    assert lowest_difference(found["dcm"], matrix) is None
