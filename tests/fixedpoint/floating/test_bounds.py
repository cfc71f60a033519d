"""Bounds of rounding in double and float: never exceeded on any kernel, by a call or a run, and not far above."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from derived import programs
from small_programs import TYPES, computed, exactly, in_long_double, node, program

import strapgen
from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.fixedpoint.floating.bounds import _accumulation
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import RoundingBounds, StepRounding
from strapgen.ir.program import Program

#: Kernels without a bound, and why.
UNBOUNDED = {
    "dcm-orthonormalize-optimal": "atan2 jumps by a turn",
    "euler-angles-from-dcm": "atan2 jumps by a turn",
    "euler-from-dcm": "rounding may turn a comparison in column_s",
    "cayley-klein-from-dcm": "rounding may turn a comparison in column_s",
    "euler-from-dcm-sheppard": "rounding may turn a comparison in column_s",
}
STEPS = ["euler-rk4-2", "dcm-rk4-2"]


def signal_values(signal, largest: float, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return nearly proper attitudes, or any vectors."""
    if signal.constraint == "unit":
        vectors = rng.normal(size=(count, signal.size))
        proper = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    elif signal.constraint == "rotation":
        proper = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0].reshape(count, 9)
    else:
        proper = rng.uniform(-largest, largest, (count, signal.size))
    return proper * rng.uniform(0.94, 1.06, (count, 1)) if signal.constraint else proper


def box_values(size: int, largest: float, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return vectors in a box: corners, numbers near powers of two, and any others."""
    values = rng.uniform(-largest, largest, (count, size))
    part = count // 4
    values[:part] = rng.choice([-largest, 0.0, largest], (part, size))
    near = 2.0 ** rng.integers(-6, 1, (part, size)) * (1 + rng.uniform(-1e-6, 1e-6, (part, size)))
    values[part : 2 * part] = np.minimum(near, 1) * largest * rng.choice([-1, 1], (part, size))
    return values


def inputs(code, bounds: RoundingBounds, count: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return inputs for which the bounds hold: half in the box, half proper; all proper where values are limited."""
    columns = {}
    for signal, condition in zip(code.inputs, bounds.inputs, strict=True):
        largest = float(condition.high)
        values = signal_values(signal, largest, count, rng)
        if not bounds.conditions:
            values[: count // 2] = box_values(signal.size, largest, count // 2, rng)
        columns |= zip(signal.elements, values.astype(TYPES[bounds.number]).T, strict=True)
    return columns


@pytest.mark.parametrize("number", TYPES)
def test_no_kernel_rounds_by_more_than_its_bound(number, rng):
    above = []
    for name, code in programs().items():
        bounds = rounding_bounds(code, number)
        if bounds.reason:
            continue
        values = inputs(code, bounds, 24, rng)
        got = computed(code, values, number)
        for k in range(24):
            exact = exactly(code, {element: column[k] for element, column in values.items()})
            for output, errors in bounds.errors.items():
                for element, error in enumerate(errors):
                    value = np.broadcast_to(got[output][element], 24)[k]
                    if abs(Fraction(float(value)) - exact[output][element]) > error:
                        above.append(f"{name}: {output}[{element}]")
    assert not above


def test_every_kernel_has_a_bound_or_a_reason():
    for name, code in programs().items():
        bounds = rounding_bounds(code)
        if name.endswith(("-truth", "-increments")):
            first = code.inputs[0].name
            assert bounds.reason == f"the range of {first} is unknown"
        else:
            assert bounds.reason == UNBOUNDED.get(name, "")
            assert bool(bounds.errors) != bool(bounds.reason)


def test_values_on_the_way_are_limited_where_they_are_divided_by():
    bounds = rounding_bounds(programs()["euler-normalize"])
    assert [(c.value, c.low, c.high) for c in bounds.conditions] == [
        ("the radicand in inverse_norm", Fraction(3, 4), Fraction(43, 32))
    ]


@pytest.mark.parametrize("number", TYPES)
def test_bounds_are_useful_where_a_root_is_divided_by(number, rng):
    for name in ("euler-normalize", "dcm-orthonormalize"):
        code = programs()[name]
        bounds = rounding_bounds(code, number)
        values = inputs(code, bounds, 30, rng)
        for condition in bounds.conditions:
            assert condition.low < 1 < condition.high or condition.low < 4 < condition.high
        (got,) = computed(code, values, number).values()
        exact = [exactly(code, {e: column[k] for e, column in values.items()}) for k in range(30)]
        (name,) = bounds.errors
        measured = max(
            abs(Fraction(float(column[k])) - exact[k][name][place])
            for place, column in enumerate(got)
            for k in range(30)
        )
        assert measured <= bounds.worst[name] <= 25 * measured


def worst_of_many(code, bounds: RoundingBounds, count: int, rng: np.random.Generator) -> list[float]:
    """Return the largest measured error of each element of the state."""
    worst = np.zeros(code.outputs[0].signal.size)
    for _ in range(0, count, 20_000):
        values = inputs(code, bounds, 20_000, rng)
        (got,) = computed(code, values, bounds.number).values()
        (exact,) = in_long_double(code, values).values()
        worst = np.maximum(worst, [float(np.abs(g - e).max()) for g, e in zip(got, exact, strict=True)])
    return list(worst)


@pytest.mark.long
@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("number", TYPES)
def test_the_bound_of_a_call_is_at_most_four_times_the_worst_of_many(name, number, rng):
    code = programs()[name]
    bounds = rounding_bounds(code, number)
    for error, worst in zip(bounds.errors["next"], worst_of_many(code, bounds, 200_000, rng), strict=True):
        # The reference has an error of its own, a thousandth of that of a double.
        assert worst <= float(error) * 1.001
        assert float(error) <= 4 * worst


def halves(code) -> tuple[Program, Program]:
    """Return the transition of a step, and its product with a state."""
    product_names = {node.name for node in code.outputs[0].nodes}
    product = tuple(a for a in code.body if a.name in product_names)
    rest = tuple(a for a in code.body if a.name not in product_names)
    transition = replace(code, body=rest, outputs=(code.transition,), transition=None)
    inputs = (code.inputs[0], code.transition.signal)
    return transition, replace(code, body=product, inputs=inputs, transition=None)


@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("number", TYPES)
def test_a_step_rounds_its_transition_and_its_product_by_nearly_their_bounds(name, number, rng):
    code = programs()[name]
    bounds = rounding_bounds(code, number)
    transition, product = halves(code)
    values = inputs(code, bounds, 20_000, rng)
    (elements,) = computed(transition, values, number).values()
    (exact,) = in_long_double(transition, values).values()
    state = {name: values[name] for name in code.inputs[0].elements}
    values = state | dict(zip(code.transition.signal.elements, elements, strict=True))
    (near,) = computed(product, values, number).values()
    (far,) = in_long_double(product, values).values()
    pairs = [(bounds.step.local, near, far), (bounds.step.transition, elements, exact)]
    for errors, approximate, reference in pairs:
        for error, one, other in zip(errors, approximate, reference, strict=True):
            worst = float(np.abs(one - other).max())
            # The reference has an error of its own, a thousandth of that of a double.
            assert worst <= float(error) * 1.001
            assert float(error) <= 4 * worst
    # Ranges are those of intervals, in which an increment may differ from itself.
    for away, one, other in zip(bounds.step.away, exact, code.attitude_step.identity, strict=True):
        distance = float(np.abs(one - one.dtype.type(other)).max())
        assert distance <= float(away) <= 2.5 * distance


LARGEST = {"state": Fraction(17, 16), "increments": Fraction(1, 8)}


@pytest.mark.parametrize(
    ("name", "local", "transition", "length", "stretched"),
    [
        # A product of Euler parameters is as long as both of them: 17/8, and 5.
        ("euler-rk4-2", (1, 2, 2, 4), (2, 1, 2, 4), 5, 5 * 17 / 8),
        # A row of equal elements stretches a matrix of equal rows by its length: 17/16 root(3), and root(3) 3.
        ("dcm-rk4-2", (0, 0, 1, 1, 2, 2, 0, 0, 0), 3 * (1, 2, 2), 3, 17 / 16 * 3 * 3),
    ],
)
def test_the_error_of_a_step_is_that_of_its_product_and_what_its_transition_makes_of_a_state(
    name, local, transition, length, stretched
):
    code, scale = programs()[name], Fraction(1, 10**9)
    parts = ([scale * part for part in numbers] for numbers in (local, transition))
    step = StepRounding(*map(tuple, parts), away=(Fraction(0),) * len(local))
    limits = {s.name: size for s, size in zip(code.inputs, LARGEST.values(), strict=True)}
    large = [Fraction(1)] * len(local)
    assert float(_accumulation(code, limits, step, large).per_step / scale) == pytest.approx(
        length + stretched
    )
    # Where the errors of the elements are known to be smaller, those of the largest row count.
    small = [scale * part / 2 for part in local]
    assert float(_accumulation(code, limits, step, small).per_step / scale) == pytest.approx(length / 2)


def test_a_transition_that_calls_functions_stretches_by_no_more_than_its_distance_from_the_identity():
    code = strapgen.lower(strapgen.derive("euler", method="magnus2", increments=1))
    code = replace(code, info=replace(code.info, attitude_step=replace(code.attitude_step, isometry=False)))
    zero, away = (Fraction(0),) * 4, tuple(map(Fraction, (0, 3, 4, 0)))
    limits = {s.name: size for s, size in zip(code.inputs, LARGEST.values(), strict=True)}
    growth = _accumulation(code, limits, StepRounding(zero, zero, away), zero).growth
    assert 0 <= growth - (1 + 5) < Fraction(1, 10**30)


def adversarial_run(code, number: str, steps: int, rng: np.random.Generator) -> list[float]:
    """Return the error after every step when of 64 increments those are taken that make it longest."""
    state, samples = code.inputs[0], code.inputs[1]
    width = state.shape[-1]
    near = np.array([float(x) for x in code.attitude_step.identity])
    exact = near.astype(np.longdouble)
    lengths = []
    for _ in range(steps):
        increments = rng.uniform(-1 / 8, 1 / 8, (64, samples.size)).astype(TYPES[number])
        columns = dict(zip(samples.elements, increments.T, strict=True))
        (got,) = computed(
            code, columns | dict(zip(state.elements, near[:, None], strict=True)), number
        ).values()
        (true,) = in_long_double(
            code, columns | dict(zip(state.elements, exact[:, None], strict=True))
        ).values()
        errors = np.array(np.array(got) - np.array(true), float).reshape(-1, width, 64)
        rows = np.sqrt((errors**2).sum(axis=1)).max(axis=0)
        best = int(rows.argmax())
        near, exact = np.array(got)[:, best], np.array(true)[:, best]
        lengths.append(float(rows[best]))
    return lengths


@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("number", TYPES)
def test_no_run_is_farther_off_than_the_bound_of_its_steps(name, number, rng):
    code = programs()[name]
    accumulation = rounding_bounds(code, number).accumulation
    lengths = adversarial_run(code, number, 150, rng)
    bounds = [accumulation.bound(steps) for steps in range(1, len(lengths) + 1)]
    assert all(length <= bound * 1.001 for length, bound in zip(lengths, bounds, strict=True))
    # The bound takes every rounding at its worst, and the longest stretch that a matrix of fourth order allows.
    assert bounds[-1] < 40 * lengths[-1]


@pytest.mark.parametrize("number", TYPES)
def test_the_compiled_function_computes_what_the_bounds_are_of(number, rng):
    code = programs()["euler-rk4-2"]
    values = inputs(code, rounding_bounds(code, number), 200, rng)
    (expected,) = computed(code, values, number).values()
    compiled = strapgen.backend("euler", "rk4", 2, "c" if number == "double" else "c-float")
    state, increments = (np.stack([values[name] for name in s.elements], axis=-1) for s in code.inputs)
    assert np.array_equal(compiled.step(state, increments.reshape(-1, 2, 3)), np.stack(expected, axis=-1))


def test_smaller_increments_have_a_smaller_bound():
    code = programs()["dcm-rk4-2"]
    slow = Settings.of(max_rate_deg_s=400, step="0.01", increments=2)
    assert rounding_bounds(code, "double", slow).worst["next"] < Fraction(666, 10**18)
    assert rounding_bounds(code, "float", slow).worst["next"] < Fraction(358, 10**9)
    slow = rounding_bounds(programs()["euler-rk4-2"], "double", slow)
    assert slow.worst["next"] < Fraction(557, 10**18)
    assert slow.accumulation.growth < rounding_bounds(programs()["euler-rk4-2"]).accumulation.growth


def test_a_range_that_is_stated_gives_a_model_of_motion_a_bound():
    ranges = {"time": 10, "a": 1, "b": 2}
    bounds = rounding_bounds(programs()["sinusoidal-truth"], settings=Settings(ranges=ranges))
    assert bounds.functions == ("cos", "sin")
    assert not bounds.reason


def test_what_is_no_type_and_no_input_is_refused():
    code = programs()["euler-rk4-2"]
    with pytest.raises(InputError, match="half"):
        rounding_bounds(code, "half")
    with pytest.raises(InputError, match="rate"):
        rounding_bounds(code, settings=Settings(ranges={"rate": 1}))


def test_bounds_survive_the_cache_and_are_rounded_up_for_readers():
    for name in ("euler-rk4-2", "dcm-orthonormalize", "euler-from-dcm", "dcm-update"):
        bounds = rounding_bounds(programs()[name], "float")
        assert RoundingBounds.from_dict(json.loads(json.dumps(bounds.as_dict()))) == bounds
        data = bounds.as_data()
        for output, errors in bounds.errors.items():
            assert all(
                Fraction(shown) >= error for shown, error in zip(data["errors"][output], errors, strict=True)
            )


def test_a_long_chain_of_sums_is_bounded_by_the_sum_of_their_roundings():
    body = {f"y{k}": node("add", f"y{k - 1}" if k else "a", "b") for k in range(20)}
    code = program(body, {"a": 1, "b": Fraction(1, 32)}, "y19")
    (error,) = rounding_bounds(code, "float").errors["out"]
    assert error == 20 * Fraction(1, 1 << 24)
