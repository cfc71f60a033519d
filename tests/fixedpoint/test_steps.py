"""Steps by exponentials and with previous increments in fixed point: inside their certified bounds."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from derived import precisely, program, quantized

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.run.exact import propagate
from strapgen.run.increments import windows

EXPONENTIALS = ("magnus2", "magnus4", "magnus6", "munthe-kaas4")


def unit_state(algorithm: str, rng: np.random.Generator) -> np.ndarray:
    if algorithm == "dcm":
        return strapgen.motion("coning", a_deg_s=30, b_deg_s=20, g_deg_s=10).attitude(rng.uniform(1, 9))
    state = rng.normal(size=4)
    return state / np.linalg.norm(state)


def exact_step(
    kernel: strapgen.kernel.kernel.Kernel, state: np.ndarray, samples: np.ndarray
) -> list[mpmath.mpf]:
    names = [name for signal in kernel.inputs for name in signal.elements]
    numbers = map(mpmath.mpf, [*state.ravel().tolist(), *samples.ravel().tolist()])
    known = precisely(kernel, dict(zip(names, numbers, strict=True)))
    return [known[name] for name in kernel.outputs[0].signal.elements]


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "previous"), [*((m, 0) for m in EXPONENTIALS), ("magnus4", 1), ("rk4", 2)]
)
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_a_call_is_inside_its_bound(algorithm, method, previous, rng):
    kernel = strapgen.derive(algorithm, method, 2, previous=previous)
    backend = strapgen.backend(algorithm, method, 2, "fixed-model", previous=previous)
    evaluator = backend.evaluator
    state_argument = backend.interface.inputs[0]
    (result,) = backend.interface.outputs
    worst = 0.0
    with mpmath.workdps(40):
        for size in (0.124, 0.01, 1e-6, 0.0):
            state = evaluator.numbers(
                state_argument, evaluator.integers(state_argument, unit_state(algorithm, rng))
            )
            increments = backend.representable(rng.uniform(-size, size, size=(2 + previous, 3)))
            found = backend.step(state, increments)
            exact = exact_step(kernel, state, increments)
            for value, wanted, bound in zip(found.ravel(), exact, result.errors, strict=True):
                off = abs(mpmath.mpf(float(value)) - wanted)
                assert off <= float(bound)
                worst = max(worst, float(off / result.format.unit))
    assert worst > 0.3, "something is rounded"


@pytest.mark.parametrize("method", EXPONENTIALS)
@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_the_bound_of_an_exponential_is_a_few_places(algorithm, method):
    # The root of a small square is inexact; cosine and sin(x)/x are taken from the square itself.
    fixed = quantized(Choice(algorithm, method, 2), Settings())
    unit = fixed.formats["next"].unit
    assert fixed.error_bounds["next"] <= 5 * unit
    # Its transitions are rotations: errors add up and do not grow.
    assert fixed.interface.accumulation.growth == 1


@pytest.mark.parametrize(
    "carry", ["none", *(pytest.param(c, marks=pytest.mark.long) for c in ("state", "full"))]
)
@pytest.mark.parametrize("name", ["c-fixed32", pytest.param("c-fixed16", marks=pytest.mark.long)])
@pytest.mark.parametrize(("algorithm", "method"), [("euler", "magnus4"), ("dcm", "munthe-kaas4")])
def test_a_run_of_exponentials_is_inside_its_bound(algorithm, method, name, carry, rng):
    settings = Settings(carry=carry).fitted(0.03)
    backend = strapgen.backend(algorithm, method, 2, name, settings=settings)
    increments = rng.uniform(-0.03, 0.03, size=(200, 2, 3))
    for given, rounded in ((backend.representable(increments), False), (increments, True)):
        exact = propagate(program(Choice(algorithm, method, 2)), given)
        off = np.linalg.norm(backend.propagate(given) - exact, axis=-1).max()
        bound = backend.rounding_bound(200, rounded)
        assert off <= bound < (3e-6 if name == "c-fixed32" else 0.2)


@pytest.mark.parametrize("largest", [Fraction(1, 100), Fraction(1, 2), 2, 4])
def test_an_exponential_for_increments_of_any_size(largest):
    # Beyond 5/4 rad the angle is reduced, and the root is taken.
    fixed = quantized(Choice("euler", "magnus4", 2), Settings().fitted(float(largest)))
    few_places, root_near_zero = Fraction(8) / 2**30, Fraction(1, 500)
    assert fixed.error_bounds["next"] < (few_places if largest < 1 else root_near_zero)


@pytest.mark.long
def test_a_minute_of_a_window_is_the_integers_of_the_model():
    """Six thousand steps with all feedback; `benchmarks/window_fixed_point.py` runs an hour."""
    samples = strapgen.motion("random", rate_deg_s=60).samples(Fraction(1, 100), -7, 6_007)
    windows = np.lib.stride_tricks.sliding_window_view(samples, 15, axis=0).swapaxes(1, 2)
    c, model = (
        strapgen.backend("euler", "window-7-7", None, name, settings=Settings(carry="full")).propagate(
            windows
        )
        for name in ("c-fixed32", "fixed-model")
    )
    assert len(c) == 6_001
    np.testing.assert_array_equal(c, model)


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "full"])
@pytest.mark.parametrize("method", ["magnus4", pytest.param("munthe-kaas4", marks=pytest.mark.long)])
def test_c_gives_the_integers_of_the_model(method, carry, rng):
    increments = rng.normal(scale=0.01, size=(200, 2, 3))
    settings = Settings(carry=carry)
    by = [
        strapgen.backend("euler", method, 2, name, settings=settings) for name in ("c-fixed32", "fixed-model")
    ]
    found = [backend.propagate(increments) for backend in by]
    np.testing.assert_array_equal(*found)
    exact = strapgen.backend("euler", method, 2, "numpy").propagate(by[0].representable(increments))
    # Every call adds at most its bound, and the transitions are rotations.
    (result,) = by[0].interface.outputs
    most = 200 * 2 * float(max(result.errors)) * (2 if carry == "full" else 1)
    assert np.abs(found[0] - exact).max() <= most


@pytest.mark.parametrize("carry", ["none", "full"])
@pytest.mark.parametrize(
    ("algorithm", "count", "previous"), [("euler", 1, 2), pytest.param("dcm", 1, 2, marks=pytest.mark.long)]
)
def test_a_run_with_previous_increments_is_inside_its_bound(algorithm, count, previous, carry, rng):
    settings = Settings(carry=carry)
    backend = strapgen.backend(algorithm, "rk4", count, "c-fixed32", settings=settings, previous=previous)
    row = rng.normal(scale=0.01, size=(previous + 300 * count, 3))
    increments = backend.representable(windows(row, count, previous))
    found = backend.propagate(increments)
    exact = strapgen.backend(algorithm, "rk4", count, "numpy", previous=previous).propagate(increments)
    off = np.linalg.norm(found - exact, axis=-1).max()
    bound = backend.rounding_bound(300)
    # Double precision is off itself by less than 16 units of round-off a step.
    assert off <= bound + 300 * 16 * 2.0**-53
    assert bound < 1e-5
