"""Jacobians of attitude steps: difference quotients in many digits, and counts beside general tools."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from derived import kernel, program
from scipy.spatial.transform import Rotation

import strapgen
from strapgen.catalogue import choose
from strapgen.ir.exceptions import InputError

#: Methods of every way to differentiate: few vectors, a rotation vector, stage by stage; with their samples.
QUICK = {
    ("euler", "rk4"): (2, 0, 0),
    ("dcm", "rk4"): (2, 0, 0),
    ("euler", "magnus4"): (2, 0, 0),
    ("cayley-klein", "coning-combined"): (2, 1, 0),
    ("euler", "rk3"): (3, 0, 0),
}
LONG = {
    ("dcm", "coning-combined"): (3, 3, 0),
    ("euler", "window-3-3"): (1, 3, 3),
    ("cayley-klein", "taylor4"): (2, 0, 0),
    ("euler", "crouch-grossman3"): (2, 0, 0),
    ("euler", "magnus6"): (3, 0, 0),
    ("dcm", "munthe-kaas4"): (2, 0, 0),
    ("euler", "fit-exact"): (2, 0, 0),
    ("euler", "coning-shaped-8"): (1, 8, 0),
}
EVERY = [*QUICK, *(pytest.param(*case, marks=pytest.mark.long) for case in LONG)]


def chosen(name, algorithm, method):
    increments, previous, ahead = {**QUICK, **LONG}[algorithm, method]
    return choose(name, method, increments, previous=previous, ahead=ahead)


def differences(algorithm, method, state, increments):
    """Return the Jacobians of the step itself by central differences in 40 digits, with what they leave below 1e-20."""
    step = kernel(chosen(algorithm, algorithm, method))
    names = [list(signal.elements) for signal in step.inputs]
    with mpmath.workdps(60):
        here = dict(
            zip(names[0] + names[1], map(mpmath.mpf, [*state.ravel(), *increments.ravel()]), strict=True)
        )
        apart = mpmath.mpf(10) ** -12

        def at(values):
            return step.expand(values, lambda number: mpmath.mpf(number.p) / number.q)["next"]

        matrices = []
        for group in names:
            columns = []
            for name in group:
                ends = [at(here | {name: here[name] + sign * apart}) for sign in (1, -1)]
                columns.append([(a - b) / (2 * apart) for a, b in zip(*ends, strict=True)])
            matrices.append(np.array(columns, float).T)
    return matrices


def in_many_digits(jacobian, inputs):
    """Return the outputs of a kernel of Jacobians, computed in 60 digits, each as a matrix of floats."""
    elements = [element for signal in jacobian.inputs for element in signal.elements]
    numbers = map(mpmath.mpf, np.concatenate([values.ravel() for values in inputs]))
    with mpmath.workdps(60):
        values = dict(zip(elements, numbers, strict=True))
        outputs = jacobian.expand(values, lambda number: mpmath.mpf(number.p) / number.q)
    return [
        np.array(outputs[stage.signal.name], float).reshape(stage.signal.shape) for stage in jacobian.outputs
    ]


def point(choice, size, rng):
    """Return a state of length 1 and increments of a size."""
    state, samples = (signal.shape for signal in kernel(choice).inputs)
    start = rng.normal(size=state)
    return start / (np.linalg.norm(start) if len(state) == 1 else 1), rng.normal(size=samples) * size


@pytest.mark.parametrize(("algorithm", "method"), EVERY)
@pytest.mark.parametrize("size", [0.1, 1e-7], ids=["ordinary", "small"])
def test_jacobians_are_the_limits_of_differences(algorithm, method, size, rng):
    choice = chosen(f"{algorithm}-jacobian", algorithm, method)
    state, increments = point(choice, size, rng)
    derived = in_many_digits(kernel(choice), (state, increments))
    for one, other in zip(derived, differences(algorithm, method, state, increments), strict=True):
        # Both are rounded to double, once.
        assert np.abs(one - other).max() <= 2.0**-52 * np.abs(other).max()


#: One of few vectors, which the counts of operations need too, and one of a rotation vector.
IN_NUMPY = [
    ("euler", "rk4"),
    ("dcm", "rk4"),
    pytest.param("cayley-klein", "coning-combined", marks=pytest.mark.long),
    pytest.param("dcm", "coning-combined", marks=pytest.mark.long),
]


@pytest.mark.parametrize(("algorithm", "method"), IN_NUMPY)
@pytest.mark.parametrize("size", [0.1, 1e-7], ids=["ordinary", "small"])
def test_numpy_computes_them(algorithm, method, size, rng):
    choice = chosen(f"{algorithm}-jacobian", algorithm, method)
    state, increments = point(choice, size, rng)
    computed = strapgen.evaluator(choice)(state, increments)
    for one, other in zip(computed, in_many_digits(kernel(choice), (state, increments)), strict=True):
        assert np.abs(one - other).max() <= 1e-12 * np.abs(other).max()


@pytest.mark.parametrize(
    ("algorithm", "method", "previous", "most"),
    # The fewest that SymForce, wrenfold and CasADi take, as benchmarks/jacobians.py counts them on their code.
    [
        ("euler", "rk4", 0, 708),
        ("dcm", "rk4", 0, 954),
        pytest.param("euler", "coning-combined", 3, 6471, marks=pytest.mark.long),
        pytest.param("dcm", "coning-combined", 3, 12392, marks=pytest.mark.long),
    ],
)
def test_they_take_fewer_operations_than_common_subexpressions_do(algorithm, method, previous, most):
    operations = program(choose(f"{algorithm}-jacobian", method, previous or 2, previous=previous)).operations
    assert operations["multiply"] + operations["add"] < most


def test_rates_have_no_jacobian():
    with pytest.raises(InputError, match="takes increments; rates at nodes do not go with it"):
        choose("euler-jacobian", "rk4", rates=True)


@pytest.mark.parametrize("method", ["magnus4", pytest.param("window-3-3", marks=pytest.mark.long), "rk4"])
def test_small_errors_of_attitude_and_increments_go_through_a_step(method, rng):
    """Both conventions against the step itself, of an attitude and of increments that are off by 1e-6 rad."""
    increments, previous, ahead = {**QUICK, **LONG}.get(("euler", method), (2, 0, 0))
    options = {"increments": increments, "previous": previous, "ahead": ahead}
    matrices = strapgen.evaluator(choose("error-state", method, **options))
    step = strapgen.evaluator(choose("euler", method, **options))
    (samples,) = matrices.function.inputs
    turns = rng.normal(size=samples.shape) * 0.05
    errors, error = rng.normal(size=samples.shape) * 1e-6, rng.normal(size=3) * 1e-6
    body = Rotation.random(rng=rng)
    right, right_noise, left_noise = matrices(turns)
    ends = [
        Rotation.from_quat(step(start.as_quat(), increments))
        for start, increments in ((body, turns), (body * Rotation.from_rotvec(error), turns + errors))
    ]
    in_body = (ends[0].inv() * ends[1]).as_rotvec()
    in_reference = (ends[1] * ends[0].inv()).as_rotvec()
    # Of second order in the errors, and of the length of the step's transition, which is 1 but for its order.
    np.testing.assert_allclose(right @ error + right_noise @ errors.ravel(), in_body, atol=2e-11)
    turned = body.apply(error + left_noise @ errors.ravel())
    np.testing.assert_allclose(turned, in_reference, atol=2e-11)


@pytest.mark.parametrize("method", ["magnus4", "coning-compressed"])
def test_the_left_noise_takes_velocity_increments_to_their_change(method, rng):
    """Of dual numbers: the velocity change is the turn by the velocity increments in place of errors."""
    matrices, change = (
        strapgen.evaluator(choose(name, method, 2)) for name in ("error-state", "velocity-position")
    )
    turns, pushes = rng.normal(size=(2, 2, 3)) * 0.05
    np.testing.assert_allclose(matrices(turns)[2] @ pushes.ravel(), change(turns, pushes)[0], atol=1e-15)


#: Vectors of a step with a method and its samples.
VECTORS = {
    "rotation-vector": ("coning-combined", 2, 1),
    "sculling": ("coning-compressed", 3, 0),
    "velocity-position": ("magnus4", 2, 0),
}


@pytest.mark.parametrize("name", VECTORS)
def test_jacobians_of_vectors_are_the_limits_of_differences(name, rng):
    method, increments, previous = VECTORS[name]
    options = (method, increments, False, previous)
    vector, jacobian = kernel(choose(name, *options)), kernel(choose(f"{name}-jacobian", *options))
    inputs = [rng.normal(size=signal.shape) * 0.1 for signal in jacobian.inputs]
    derived = iter(in_many_digits(jacobian, inputs))
    elements = [element for signal in vector.inputs for element in signal.elements]
    apart = mpmath.mpf(10) ** -12
    with mpmath.workdps(60):
        here = dict(zip(elements, map(mpmath.mpf, np.concatenate([i.ravel() for i in inputs])), strict=True))

        def at(values):
            return vector.expand(values, lambda number: mpmath.mpf(number.p) / number.q)

        for signal in vector.inputs:
            ends = [[at(here | {e: here[e] + sign * apart}) for sign in (1, -1)] for e in signal.elements]
            for stage in vector.outputs:
                output = stage.signal.name
                columns = [
                    [(a - b) / (2 * apart) for a, b in zip(high[output], low[output], strict=True)]
                    for high, low in ends
                ]
                expected = np.array(columns, float).T
                # Both are rounded to double, once.
                assert np.abs(next(derived) - expected).max() <= 2.0**-52 * np.abs(expected).max()
    assert next(derived, None) is None
