"""Bounds of rounding in double and float: never exceeded on any kernel, by a call or a run, and not far above."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from derived import programs
from small_programs import EXACT, TYPES, computed, exactly, in_long_double, node, program

import strapgen
from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.fixedpoint.floating.bounds import _accumulation
from strapgen.fixedpoint.floating.errors import (
    NUMBERS,
    Expression,
    Expressions,
    NumberFormat,
    _ComputedNumber,
    _ComputedNumbers,
    _root_share,
    exponent,
)
from strapgen.fixedpoint.intervals import Interval, root
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.interfaces import RoundingBounds, StepRounding
from strapgen.ir.program import Operation, Program

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
def test_step_error_is_product_error_plus_transition_error(name, local, transition, length, stretched):
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
def test_compiled_function_meets_its_bounds(number, rng):
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


def test_unknown_types_and_inputs_are_refused():
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


FLOAT = NUMBERS["float"]


def off(exact: Fraction, near: Fraction) -> Operation:
    """Return a number that float computes as another one, less than 1 away: a difference of two literals.

    Around 3 * 2^22 float has whole numbers alone. Each literal lies almost half a unit beside one.
    """
    unit = Fraction(2) ** -(near.denominator.bit_length() - 1)
    half = (near - exact) / unit / 2
    literals = (3 * 2**22 + near / unit - half, 3 * 2**22 + half)
    return node("multiply", unit, node("subtract", *literals))


THREE_QUARTERS = off(Fraction(3, 4), Fraction(1))
#: Nearly 0, computed as 1/16 or as 1/4.
SIXTEENTH, QUARTER = (off(near / 2**20, near) for near in (Fraction(1, 16), Fraction(1, 4)))
#: Computed as what is smaller or larger than exact.
SMALLER, LARGER = off(Fraction(5, 4), Fraction(1)), off(Fraction(7, 4), Fraction(2))
FAR_BELOW = node("multiply", node("subtract", "a", LARGER), THREE_QUARTERS)
POSITIVE, NEGATIVE = node("at_least", "a", 0), node("at_least", 0, "a")


def squared(name: str) -> Operation:
    return node("multiply", name, name)


def measured(code: Program, *rows: dict[str, Fraction]) -> Fraction:
    """Return the largest error of a program in float whose functions take the farther of two numbers."""
    return max(
        abs(code.run(row, FLOAT.rounded, FARTHER)["out"][0] - code.run(row, operations=EXACT)["out"][0])
        for row in rows
    )


def bound(code: Program) -> Fraction:
    (error,) = rounding_bounds(code, "float").errors["out"]
    return error


def farther(value: Fraction) -> Fraction:
    """Return the number beside a value that is within one unit in the last place, but not the nearest."""
    unit = Fraction(2) ** max(exponent(abs(value)) - 23, -149)
    below = value // unit * unit
    return below if value - below > unit / 2 else below + unit


def sine(x: Fraction) -> Fraction:
    return farther(EXACT["sin"](x))


#: Operations that round to the nearest number, but for functions, which may be off by a unit in the last place.
FARTHER = EXACT | {
    kind: lambda *a, exact=EXACT[kind]: FLOAT.rounded(exact(*a))
    for kind in ("add", "subtract", "multiply", "divide", "sqrt")
}
FARTHER |= {
    "sin": sine,
    "cos": lambda x: farther(EXACT["cos"](x)),
    "sinc": lambda x: FLOAT.rounded(sine(x) / x),
}


@pytest.mark.parametrize(
    ("body", "share"),
    [
        pytest.param(body, share, id=name)
        for name, share, body in [
            ("product", 1, {"y": node("multiply", THREE_QUARTERS, node("add", THREE_QUARTERS, 1))}),
            ("square of a product", 1, {"x": FAR_BELOW, "y": squared("x")}),
            ("quotient", 1, {"y": node("divide", LARGER, SMALLER)}),
            ("square of a quotient", 1, {"x": node("divide", LARGER, SMALLER), "y": squared("x")}),
            ("root", 1, {"y": node("sqrt", SMALLER)}),
            ("inverse root", 1, {"x": node("sqrt", SMALLER), "y": node("divide", 1, "x")}),
            ("cosine", 0.99, {"y": node("cos", SIXTEENTH)}),
            ("cosine away from 0", 0.95, {"y": node("cos", off(Fraction(7, 16), Fraction(1, 2)))}),
            ("inverse sinc", 0.96, {"x": node("sinc", QUARTER), "y": node("divide", 1, "x")}),
            ("sinc away from 0", 0.98, {"y": node("sinc", off(Fraction(3, 8), Fraction(1, 2)))}),
            ("steepest sinc", 0.85, {"y": node("sinc", off(Fraction(33, 16), Fraction(17, 8)))}),
            ("maximum", 1, {"x": node("maximum", THREE_QUARTERS, "a"), "y": squared("x")}),
            ("maximum of", 1, {"x": node("maximum", "a", THREE_QUARTERS), "y": squared("x")}),
            ("selection", 1, {"x": node("select", POSITIVE, "a", THREE_QUARTERS), "y": squared("x")}),
            ("selected", 1, {"x": node("select", NEGATIVE, THREE_QUARTERS, "a"), "y": squared("x")}),
        ]
    ],
)
def test_large_error_is_bounded(body, share):
    code = program(body, {"a": Fraction(1, 2)})
    error = measured(code, {"a": Fraction(-1, 2)})
    assert share * bound(code) * (1 - Fraction(1, 10**5)) < error <= bound(code)


TINY = Fraction(1, 1 << 140)
#: A unit in the last place of numbers from 2 to 4.
UNIT = Fraction(1, 1 << 22)
#: What is added to 3 with an error of nearly half a unit upward, and downward.
UPWARD, DOWNWARD = UNIT / 2 * Fraction(1025, 1024), UNIT / 2 * Fraction(1023, 1024)
NEARLY_FOUR = {"a": 4 - UNIT, "b": UNIT * Fraction(9, 16), "c": UNIT * Fraction(9, 8)}
SHIFTED = {"c": node("add", "a", 3), "d": node("add", "b", 3)}


@pytest.mark.parametrize(
    ("body", "limits", "rows", "share"),
    [
        # Near pi/6 the sine is just above 1/2: its unit in the last place is largest beside it, and beside sin(x)/x.
        ({"y": node("sinc", "a")}, {"a": 1}, [{"a": Fraction(k, 997)} for k in range(523, 560)], 0.7),
        (
            {"y": node("sin", "a")},
            {"a": Fraction(3, 4)},
            [{"a": Fraction(k, 64)} for k in range(40, 49)],
            0.9,
        ),
        ({"y": node("cos", "a")}, {"a": 1}, [{"a": Fraction(k, 64)} for k in range(4, 65)], 0.9),
        # The smallest numbers are as far apart as they are large.
        ({"y": node("sin", "a")}, {"a": TINY}, [{"a": TINY}], 0.99),
        ({"y": node("sin", "a")}, {"a": TINY * 3 / 2}, [{"a": TINY * 3 / 2}], 0.99),
        ({"y": node("multiply", Fraction(1, 2), "a")}, {"a": 1}, [{"a": Fraction(1, 1 << 149)}], 0.99),
        ({"y": node("multiply", "a", "a")}, {"a": Fraction(1, 1 << 75)}, [{"a": Fraction(1, 1 << 75)}], 0.99),
        # The root of an underflow is far larger than it.
        (
            {"x": squared("a"), "y": node("sqrt", "x")},
            {"a": Fraction(1, 1 << 76)},
            [{"a": Fraction(1, 1 << 76)}],
            0.49,
        ),
        # The smallest odd number of 25 bits.
        ({"y": node("add", 2**24 - 1, 2)}, {"a": 1}, [{"a": Fraction(0)}], 0.99),
        # Both summands lose half a unit of theirs, and their sum, an odd number of those, one of its own.
        (
            SHIFTED | {"y": node("add", "c", "d")},
            {"a": 1, "b": 1},
            [{"a": UPWARD, "b": UPWARD + k * UNIT} for k in range(4)],
            0.99,
        ),
        (
            SHIFTED | {"x": node("subtract", "c", "d"), "y": node("add", "x", 4)},
            {"a": 1, "b": 1},
            [{"a": UPWARD + k * UNIT, "b": DOWNWARD} for k in range(4)],
            0.99,
        ),
        # The first sum is rounded to 4, and only so the second comes near the middle between two numbers.
        (
            {"x": node("add", "a", "b"), "y": node("add", "x", "c")},
            NEARLY_FOUR,
            [NEARLY_FOUR],
            0.87,
        ),
    ],
)
def test_a_rounding_at_its_worst_is_the_bound(body, limits, rows, share):
    code = program(body, limits)
    rows = [{name: FLOAT.rounded(value) for name, value in row.items()} for row in rows]
    assert share * bound(code) < measured(code, *rows) <= bound(code)


@pytest.mark.parametrize(
    "difference",
    [
        node("subtract", off(Fraction(1, 4), Fraction(0)), Fraction(1, 8)),
        node("add", off(Fraction(-1, 4), Fraction(0)), Fraction(1, 8)),
        node("subtract", off(Fraction(1, 4), Fraction(0)), Fraction(1, 4)),
    ],
)
def test_a_comparison_that_turns_is_seen(difference):
    code = program({"y": node("select", node("at_least", difference, 0), 1, -1)}, {"a": 1})
    assert measured(code, {"a": Fraction(0)}) == 2
    assert rounding_bounds(code, "float").reason == "rounding may turn a comparison in y"


# Errors relative to the exact value


COARSE = NumberFormat(4, -6, 10)
#: A share of the exact value and what is beside it, for two operands that are not negative.
PAIRS = ((Fraction(1, 9), Fraction(1, 70)), (Fraction(1, 5), Fraction(1, 90)))
LARGEST_TERMS = (Fraction(3), Fraction(2))


def relative(kind: str, ranges: list[Interval], rounding: Fraction) -> tuple[Fraction, Fraction] | None:
    """Return the relative bound of an operation on two operands."""
    expression = Expression(kind, (0, 1))
    numbers = _ComputedNumbers(Expressions(), ranges, COARSE)
    for (share, rest), largest, known in zip(PAIRS, LARGEST_TERMS, ranges, strict=True):
        numbers.items.append(
            _ComputedNumber(known, share * largest + rest, Fraction(0), relative=(share, rest))
        )
    return numbers._relative(2, expression, rounding)


@pytest.mark.parametrize("rounding", [Fraction(0), Fraction(1, 8)])
@pytest.mark.parametrize("kind", ["add", "multiply"])
def test_the_relative_bound_is_attained_where_operands_are_as_far_off_as_they_may(kind, rounding):
    told = relative(kind, [Interval.of(0, largest) for largest in LARGEST_TERMS], rounding)
    assert told is not None
    share, rest = told
    slack = []
    for exact in itertools.product(*((0, largest) for largest in LARGEST_TERMS)):
        near = [value * (1 + a) + b for value, (a, b) in zip(exact, PAIRS, strict=True)]
        value, computed = EXACT[kind](*exact), EXACT[kind](*near)
        if rounding:
            computed += computed * COARSE.unit + COARSE.underflow
        slack.append(share * value + rest - (computed - value))
    # A product has twice the product of both rests to spare.
    spare = 2 * PAIRS[0][1] * PAIRS[1][1] * (1 + COARSE.unit) if kind == "multiply" else Fraction(0)
    assert 0 <= min(slack) <= spare + Fraction(1, 10**30)


def test_a_difference_has_no_relative_bound():
    assert relative("subtract", [Interval.of(0, 3), Interval.of(0, 2)], Fraction(0)) is None
    assert relative("add", [Interval.of(0, 3), Interval.of(-2, 2)], Fraction(0)) is None


def test_the_relative_error_of_a_literal_is_all_of_it():
    numbers = _ComputedNumbers(Expressions(), [], COARSE)
    for value in (Fraction(1, 3), Fraction(17, 16), Fraction(25, 7)):
        share, rest = numbers._literal(value).relative
        assert abs(COARSE.rounded(value) - value) == pytest.approx(share * value, rel=1e-30)
        assert not rest


@pytest.mark.parametrize("share", [Fraction(k, 16) for k in range(17)])
def test_a_root_is_off_by_no_larger_share_than_its_bound(share):
    """The largest change of a root is that of a smaller radicand: 1 - root(1 - share)."""
    assert (1 - _root_share(share)) ** 2 <= 1 - share
    assert _root_share(share) <= Fraction(5, 4) * (1 - root(1 - share)) if share <= Fraction(1, 4) else True
    assert root(share) ** 2 >= share
