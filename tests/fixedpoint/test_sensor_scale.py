"""Counts of a gyro and states that saturate: the same formulas exactly, equal bits, inside the certified bounds."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from derived import program, quantized
from fixed_inputs import corners_and_random

import strapgen
from strapgen import generate
from strapgen.catalogue import Choice
from strapgen.fixedpoint.sensor_scale import _STAND_IN, _cost, _Multiplications, _note, _Scaling, in_counts
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Assignment, Constant, Operation, Reference, references
from strapgen.ir.units import Sensor
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.run.compiled_code import CEvaluator, ModelEvaluator

EULER, DCM, HEUN = Choice("euler", "rk4", 2), Choice("dcm", "rk4", 2), Choice("euler", "rk2", 1)
#: A gyro of 16 bits at 100 Hz whose whole range is used, and the same up to 400 deg/s.
WHOLE = {"sample_hz": 100, "lsb": "0.0175dps"}
SLOWER = WHOLE | {"max_rate_deg_s": 400}
CASES = [
    (EULER, SLOWER),
    (EULER, WHOLE | {"state": "q31"}),
    (EULER, WHOLE | {"word": 16, "state": "q15", "rounding": "truncation"}),
    (EULER, {"lsb": "1e-10rad", "input_bits": 32, "carry": "full"}),
    (HEUN, {"lsb": "1/100000000rad", "input_bits": 24, "state": "q31", "carry": "full"}),
    (HEUN, {"lsb": "1/262144rad", "word": 64, "state": "q63"}),
    (HEUN, {"max_rate_deg_s": 400, "sample_hz": 100, "input_bits": 16}),
    (DCM, WHOLE | {"state": "q31"}),
]


def exact_outputs(choice: Choice, fixed, words) -> list[Fraction]:
    """Return what the kernel itself makes of integers: it knows angles, no counts."""
    numbers = {}
    for argument, integers in zip(fixed.interface.inputs, words, strict=True):
        for name, integer in zip(argument.signal.elements, integers, strict=True):
            numbers[name] = int(integer) * argument.unit
    return program(choice).run(numbers)["next"]


@pytest.mark.parametrize(("choice", "stated"), CASES, ids=lambda case: getattr(case, "kernel", ""))
def test_c_is_the_model_and_inside_its_bound_on_counts(choice, stated, rng):
    fixed = quantized(choice, Settings.of(increments=choice.increments_per_step, **stated))
    model, in_c = ModelEvaluator(generate(fixed, "fixed-model")), CEvaluator(generate(fixed, "c-fixed"))
    inputs = corners_and_random(model, 400, rng)
    inputs[0][:60] = inputs[0][-60:]  # corners of the counts with attitudes
    inputs[0][1] = (
        [*np.eye(3).ravel().astype(int) * inputs[0].max()] if choice is DCM else [0, 0, 0, inputs[0].max()]
    )
    (computed,), left = model.run(inputs, model.fresh(400))
    (words,), left_in_c = in_c.run(inputs, in_c.fresh(400))
    assert np.array_equal(computed, words) and np.array_equal(left, left_in_c)
    (result,) = fixed.interface.outputs
    worst = Fraction(0)
    for sample in [*range(25), *range(100, 120), *range(380, 400)]:
        exact = exact_outputs(choice, fixed, [words[sample] for words in inputs])
        for integer, value, bound in zip(computed[sample], exact, result.errors, strict=True):
            off = abs(int(integer) * result.unit - value)
            beyond = abs(value) - 1 if result.saturates else 0
            assert off <= max(bound, beyond + result.unit * (beyond > 0))
            if beyond <= 0:
                worst = max(worst, off / bound)
    assert worst > Fraction(1, 4), "the bound is not far above what is seen"


def test_another_scale_breaks_the_bound(rng):
    fixed = quantized(EULER, Settings.of(increments=2, **WHOLE))
    model = ModelEvaluator(generate(fixed, "fixed-model"))
    inputs = [np.array([[0, 0, 0, 1 << 30]]), np.array([[32767] * 6])]
    (computed,), _ = model.run(inputs, model.fresh(1))
    exact = exact_outputs(EULER, fixed, [words[0] for words in inputs])
    (result,) = fixed.interface.outputs
    assert abs(int(computed[0, 0]) * result.unit - exact[0]) <= result.errors[0]
    numbers = {"e_x": 0, "e_y": 0, "e_z": 0, "e_s": 1}
    count = fixed.interface.inputs[1].unit * (1 + Fraction(1, 10**7))
    other = program(EULER).run(
        numbers | dict.fromkeys(fixed.interface.inputs[1].signal.elements, 32767 * count)
    )
    assert abs(int(computed[0, 0]) * result.unit - other["next"][0]) > result.errors[0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("choice", "more"),
    [(EULER, 2), (DCM, 3), (HEUN, 3), (Choice("euler", "rk4", 4), 0), (Choice("dcm", "rk2", 1), 3)],
)
def test_a_program_in_counts_is_the_same_function_for_few_multiplications(choice, more, rng):
    sensor, original = Sensor(Fraction(1237, 10**9), "", ""), program(choice)
    counts = in_counts(original, sensor)
    numbers = {n: Fraction(int(rng.integers(-99, 99)), 100) for s in original.inputs for n in s.elements}
    angles = {
        name: value * sensor.scale if name in original.inputs[1].elements else value
        for name, value in numbers.items()
    }
    assert counts.run(numbers) == original.run(angles)
    fixed = [strapgen.quantize(original, Settings.of(**lsb)) for lsb in ({}, {"lsb": "3e-6rad"})]
    few, many = (one.operations["multiply"] for one in fixed)
    assert many <= few + more


@pytest.mark.parametrize("kernel", ["euler", "dcm"])
def test_multiplications_are_counted_without_writing_them(kernel, rng):
    body = program(Choice(kernel, "rk4", 3)).body
    found = set()
    for _ in range(20):
        weights = {name: int(rng.integers(-2, 4)) for a in body for name in (a.name, *references(a.value))}
        counting, writing = _Multiplications(weights), _Scaling(weights, _STAND_IN)
        numbers = [counting.number(assignment) for assignment in body]
        assert numbers == [_cost(writing.assigned(assignment)) for assignment in body]
        found |= {*numbers}
    assert len(found) > 3


@pytest.mark.parametrize(
    ("value", "counted"),
    [
        (Operation("multiply", (Reference("a"), Constant(Fraction(3)))), 1),
        (Operation("multiply", (Reference("a"), Constant(1 / _STAND_IN))), 0),
        (Operation("multiply", (Reference("b"), Constant(_STAND_IN**2 / 4))), 0),
        (Operation("multiply", (Reference("a"), Constant(Fraction(0)))), 0),
        (Operation("sqrt", (Operation("multiply", (Reference("a"), Constant(Fraction(-8)))),)), 1),
        (Operation("multiply", (Operation("sqrt", (Constant(Fraction(2)),)), Reference("a"))), 2),
    ],
)
def test_shifts_are_no_multiplications(value, counted):
    weights, assignment = {"a": 1, "b": -2}, Assignment("y", value)
    assert _Multiplications(weights).number(assignment) == counted
    assert _cost(_Scaling(weights, _STAND_IN).assigned(assignment)) == counted


def test_a_count_of_a_power_of_two_leaves_the_program_alone():
    assert in_counts(program(EULER), Sensor(Fraction(1, 1 << 18), "", "")) is program(EULER)


def test_functions_are_computed_from_angles():
    # Their series know nothing of a scale.
    choice = Choice("euler", "magnus4", 2)
    fixed = [
        quantized(choice, Settings.of(**stated)) for stated in ({"largest_angle": "0.1"}, {"lsb": "3e-6rad"})
    ]
    angles, counts = (one.error_bounds["next"] for one in fixed)
    assert counts < 2 * angles


def test_a_state_at_the_identity_saturates_in_each_step_and_does_not_drift():
    increments = np.tile([[[3e-6, 0, 0], [-3e-6, 0, 0]]], (4000, 1, 1))
    increments[::2] *= -1
    settings = Settings.of(lsb="3e-6rad", state="q31")
    backend = strapgen.backend("euler", "rk4", 2, "c-fixed32", settings=settings)
    states = backend.propagate(increments)
    exact = strapgen.backend("euler", "rk4", 2, "c").propagate(increments)
    assert (states[:, 3] == 1 - 2.0**-31).mean() > 0.99
    apart = np.linalg.norm(states - exact, axis=-1)
    assert apart.max() <= 2.0**-30
    steps = np.array([1, 10, 100, 4000])
    assert all(apart[n] <= backend.rounding_bound(int(n)) for n in steps)


@pytest.mark.parametrize("carry", [pytest.param("none", marks=pytest.mark.long), "full"])
def test_a_run_with_a_state_that_saturates_is_inside_its_bound(carry, rng):
    # Turns through the identity, where the largest element reaches 1.
    angles = np.rint(9000 * np.sin(np.arange(6000) * 0.05)).reshape(-1, 2, 1) * [1.0, 0.0, 0.0] * 3e-6
    settings = Settings.of(lsb="3e-6rad", state="q31", carry=carry)
    backend = strapgen.backend("euler", "magnus4", 2, "c-fixed32", settings=settings)
    exact = strapgen.backend("euler", "magnus4", 2, "c").propagate(angles)
    apart = np.linalg.norm(backend.propagate(angles) - exact, axis=-1)
    assert np.abs(exact).max() < 1 + 1e-12
    assert all(apart[n] <= backend.rounding_bound(n) for n in range(1, 3001, 37))


def test_kernels_of_a_saturating_step_take_its_state():
    settings = Settings.of(lsb="3e-6rad", state="q31")
    backend = strapgen.backend("euler", "rk4", 2, "c-fixed32", settings=settings)
    states = backend.propagate(np.full((50, 2, 3), 3e-3), orthonormalize_every=5)
    assert np.abs(np.linalg.norm(states, axis=-1) - 1).max() < 4 * 2.0**-31


def test_options_not_for_counts_are_refused():
    settings = Settings.of(lsb="3e-6rad")
    with pytest.raises(InputError, match="takes no increments; an lsb does not go with it"):
        quantized(Choice("euler-normalize"), settings)
    with pytest.raises(InputError, match="takes no state that saturates"):
        two_speed_sources.sources("dcm", 2, "c-fixed", Settings.of(lsb="3e-6rad", state="q31"))
    with pytest.raises(InputError, match="the format of increments follows from their bits"):
        quantized(EULER, Settings.of(lsb="3e-6rad", formats={"increments": "Q0.31"}))


def test_scaled_values_are_named_for_readers():
    sensor = SimpleNamespace(scale=Fraction(1, 8), is_rounded=False)
    body = tuple(Assignment(name, Reference("x")) for name in ("a_x", "a_y", "b", "c"))
    code = SimpleNamespace(body=body)
    start = "The increments are counts; with s = 0.125, an angle in rad is s times its number in the code"
    assert _note(code, {}, sensor) == f"{start}."
    told = _note(code, {"a_x": 1, "a_y": 1, "c": 2}, sensor)
    assert told.startswith(f"{start}. Powers of s are in the constants, and values are divided: ")
    assert told.endswith("c by s^2; a by s.")


def test_count_at_the_largest_rate_is_inside_the_range():
    """400 deg/s at 100 Hz are 22857.14 counts of 0.0175 deg/s: a gyro that rounds up says 22858."""
    settings = Settings.of(max_rate_deg_s=400, sample_hz=100, lsb="0.0175dps", increments=2)
    increments = quantized(Choice("euler", "rk4", 2), settings).interface.inputs[1]
    assert (increments.low, increments.high) == (-22858, 22858)
