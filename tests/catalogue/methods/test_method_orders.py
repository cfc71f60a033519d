"""Every family of methods: its order on any rate in exact series, and that its transition is a rotation."""

from __future__ import annotations

from random import Random

import mpmath
import pytest
import sympy as sp
from derived import precisely
from peano_baker import evaluated, generic_rate, local_error, lowest_difference, true_rotation, turns

from strapgen import derive
from strapgen.catalogue import ALGORITHMS, STANDARD_METHODS
from strapgen.catalogue.methods.rotation_series import magnus
from strapgen.catalogue.methods.runge_kutta import munthe_kaas

FEW = ((1, 1), (2, 0), (3, 0), (4, 0), (5, 0), (2, 2), (3, 1))
#: Samples of the step, and samples from before it, by method: the method or the samples limit the order.
SAMPLES = {
    **dict.fromkeys(STANDARD_METHODS, ((2, 0), (3, 0), (5, 0), (8, 0))),
    **{f"taylor{order}": ((order, 0),) for order in range(1, 8)},
    "taylor8": ((2, 0), (3, 0), (4, 0), (1, 1), (2, 1), (1, 2), (1, 3), (8, 0)),
    **dict.fromkeys(("magnus2", "magnus4"), ((4, 0), (5, 0), (3, 2))),
    "magnus6": ((1, 0), (2, 0), (3, 0), (1, 1), (1, 2), (2, 1), (4, 0), (5, 0), (3, 2)),
    "munthe-kaas4": ((2, 0), (3, 0), (4, 0), (1, 2), (2, 3)),
    "crouch-grossman3": ((3, 0),),
    **dict.fromkeys(("coning-compressed", "coning-uncompressed"), FEW),
    "coning-combined": (*FEW, (1, 3), (6, 0), (7, 0)),
    "coning-polynomial": ((3, 0), (4, 0), (7, 0)),
}
#: Coning methods write one rotation vector for all parameters; the others are applied to each of them.
CASES = [
    (algorithm, method, *samples)
    for method in SAMPLES
    for samples in SAMPLES[method]
    for algorithm in (("euler",) if method.startswith("coning") else ALGORITHMS)
]
QUICK = {
    ("dcm", "rk2", 2, 0),
    ("euler", "rk4", 2, 0),
    ("cayley-klein", "taylor3", 3, 0),
    ("euler", "magnus4", 4, 0),
    ("dcm", "munthe-kaas4", 2, 0),
    ("euler", "coning-combined", 3, 0),
}


@pytest.mark.parametrize(
    ("algorithm", "method", "count", "previous"),
    [pytest.param(*case, marks=() if case in QUICK else pytest.mark.long) for case in CASES],
)
def test_local_error_is_one_order_above_the_stated_one(algorithm, method, count, previous):
    kernel = derive(algorithm, method, count, previous=previous)
    order = kernel.order.step
    rate = generic_rate(min(count + previous, order) + 1)
    assert local_error(kernel, rate, order + 2) == order + 1


@pytest.mark.parametrize("method", ["rk2", "rk3", "rk4"])
def test_one_increment_cannot_see_coning(method):
    # The commutator of rates at two instants, of power 3, is lost, whatever the method.
    assert local_error(derive("euler", method, 1), generic_rate(3), 6) == 3


#: Methods on rates at their nodes, with the root that is in these.
AT_NODES = {
    "magnus2": (magnus(2), None),
    "magnus4": (magnus(4), sp.sqrt(3)),
    "magnus6": (magnus(6), sp.sqrt(15)),
    "munthe-kaas4": (munthe_kaas(4), None),
}


@pytest.mark.long
@pytest.mark.parametrize("name", AT_NODES)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_rates_at_nodes_give_the_order_of_the_method(algorithm, name):
    # In the field of the nodes' roots, so that the series stay exact.
    method, root = AT_NODES[name]
    field = sp.QQ if root is None else sp.QQ.algebraic_field(root)
    kernel, top = derive(algorithm, name, rates=True), method.order + 1
    assert kernel.order.extraction is None and kernel.order.step == method.order
    rate = generic_rate(top, field)
    nodes = [field.from_sympy(sp.sympify(node)) for node in method.nodes]
    values = dict(zip(kernel.inputs[1].elements, turns(rate, nodes, top), strict=True))
    found = evaluated(kernel, values, kernel.transition, field)
    assert lowest_difference(found, true_rotation(algorithm, rate, top)) == top


@pytest.mark.parametrize(("count", "previous"), [(1, 0), (3, 0), (2, 2)])
@pytest.mark.parametrize(
    "method",
    [
        *("magnus2", "magnus4", "magnus6", "munthe-kaas4"),
        *(f"coning-{form}" for form in ("compressed", "uncompressed", "combined", "polynomial")),
    ],
)
def test_about_one_axis_the_rotation_vector_is_the_sum_of_the_increments(method, count, previous):
    # Whatever the sizes are, those before the step too: no product of second or higher order is left. The quadrature of
    # munthe-kaas4 is exact for cubic rates.
    kernel = derive("rotation-vector", method, count, previous=previous)
    ring, *axis = sp.ring("x y z", sp.QQ)
    random = Random(19)
    sizes = [sp.QQ(random.randint(-9, 9), random.randint(1, 5)) for _ in range(count + previous)]
    increments = [size * x for size in sizes for x in axis]
    (phi,) = kernel.expand(dict(zip(kernel.inputs[0].elements, increments, strict=True))).values()
    assert [ring(x) for x in phi] == [sum(sizes[previous:]) * x for x in axis]


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "method", "count", "previous"),
    [
        *((name, method, 3, 1) for name in ALGORITHMS for method in ("magnus4", "magnus6", "munthe-kaas4")),
        *((name, *step) for name in ALGORITHMS for step in (("taylor1", 3, 0), ("taylor4", 2, 2))),
        *(("dcm", "taylor8", 8, 0), ("euler", "taylor5", 3, 0), ("euler", "taylor20", 8, 3)),
        ("euler", "crouch-grossman3", 2, 0),
    ],
)
def test_transition_is_a_rotation_whatever_the_increments_are(algorithm, method, count, previous):
    kernel, random = derive(algorithm, method, count, previous=previous), Random(1969)
    assert kernel.attitude_step.isometry
    signal = next(stage.signal for stage in kernel.stages if stage.signal.name == kernel.transition)
    state = dict.fromkeys(kernel.inputs[0].elements, mpmath.mpf(0))
    with mpmath.workdps(60):
        for size in (10**-4, 1, 5):
            values = {
                n: mpmath.mpf(random.randint(-999, 999)) * size / 1000 for n in kernel.inputs[1].elements
            }
            known = precisely(kernel, state | values)
            flat = [known[name] for name in signal.elements]
            turn = mpmath.matrix([flat[k : k + 3] for k in (0, 3, 6)] if signal.shape == (3, 3) else flat)
            product = turn.T * turn
            assert mpmath.mnorm(product - mpmath.eye(product.rows)) < mpmath.mpf(10) ** -50
            if algorithm == "dcm":
                assert abs(mpmath.det(turn) - 1) < mpmath.mpf(10) ** -50
