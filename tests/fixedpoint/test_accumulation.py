"""Errors over a run: how far a value moves with the inputs, what feedback adds, how far a transition stretches."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from fractions import Fraction
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from derived import program, quantized
from small_integers import computed, with_feedback

import strapgen
from strapgen import generate
from strapgen.catalogue import Choice, choose_step
from strapgen.fixedpoint import accumulation as accumulation_module
from strapgen.fixedpoint.accumulation import (
    StepErrors,
    _away,
    _moves,
    accumulation,
    singular_value_bounds,
    step_errors,
    transition_growth,
)
from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import (
    ErrorPropagation,
    ExactOperation,
    InputElement,
    Quantities,
    Quantity,
    Sum,
)
from strapgen.fixedpoint.quantization import _plan, _walk
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import OPERATIONS, Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.compiled_code import ModelEvaluator


def test_sum_of_products_moves_by_at_most_its_bound():
    # 3 a b + a, a up to 1 and moved by 1/8, b up to 1/4 and moved by 1/2
    a, b = (
        Signal(name, (1,), (name,), bound=bound)
        for name, bound in (("a", Fraction(1)), ("b", Fraction(1, 4)))
    )
    multiple = Operation(
        "multiply", (Constant(Fraction(3)), Operation("multiply", (Reference("a"), Reference("b"))))
    )
    body = (Assignment("y", Operation("add", (multiple, Reference("a")))),)
    result = Result(Signal("out", (1,), ("out_1",)), (Reference("y"),))
    made = Program(KernelInfo("made", "Made by hand", ""), (a, b), body, (result,))
    box = {"a": Interval.symmetric(1), "b": Interval.symmetric(Fraction(1, 4))}
    by = {"a": Fraction(1, 8), "b": Fraction(1, 2)}

    def value(x: Fraction, y: Fraction) -> Fraction:
        return 3 * x * y + x

    corners = product(*(((s, t) for s in (-1, 1) for t in (-1, 1)) for _ in range(2)))
    farthest = max(
        abs(value(p + s * by["a"], q / 4 + t * by["b"]) - value(Fraction(p), Fraction(q, 4)))
        for (p, s), (q, t) in (
            (tuple(map(Fraction, one)), tuple(map(Fraction, other))) for one, other in corners
        )
    )
    assert farthest == _moves(quantities(made, box), by)["y"]


@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
def test_a_call_is_inside_its_bound_whatever_the_call_before_left(rounding):
    choice = Choice("navigation-rotation")
    fixed = quantized(choice, Settings(16, rounding=rounding, carry="state"))
    interface, rng = fixed.interface, np.random.default_rng(1)
    model = ModelEvaluator(generate(fixed, "fixed-model"))
    bounds = [error for argument in interface.outputs for error in argument.errors]
    worst = Fraction(0)
    for _ in range(40):
        integers = [rng.integers(a.low, a.high + 1, a.signal.size).tolist() for a in interface.inputs]
        left = [int(rng.choice([0, 2**16 - 1])) for _ in interface.residuals]
        *computed, _ = model.step(*integers, left)
        values = {
            name: integer * argument.format.unit
            for argument, row in zip(interface.inputs, integers, strict=True)
            for name, integer in zip(argument.signal.elements, row, strict=True)
        }
        exact = [x for row in program(choice).run(values).values() for x in row]
        rounded = [
            x * argument.format.unit
            for argument, row in zip(interface.outputs, computed, strict=True)
            for x in row
        ]
        errors = [abs(a - b) for a, b in zip(exact, rounded, strict=True)]
        assert all(error <= bound for error, bound in zip(errors, bounds, strict=True))
        worst = max(worst, *errors)
    # Half a unit or a whole one is left before, and as much after: without the first the bound would not hold.
    assert worst > Fraction(3, 4) * interface.outputs[0].format.unit


# How far a value moves, by other ways than products


def quantity(name, definition, low=-1, high=1, **more) -> Quantity:
    return Quantity(name, definition, Fraction(0), Interval.of(low, high), **more)


def test_roots_and_functions_move_too():
    one = Fraction(1)
    slopes = ErrorPropagation((("a", Fraction(3)), ("b", None)), Fraction(5))
    items = {
        "a": quantity("a", InputElement("x")),
        "b": quantity("b", InputElement("z")),
        "double": quantity("double", Sum(((("a",), 2 * one),)), exact_addends=((("a",), -one / 2),)),
        # The root moves most from zero: to the root of what its argument moves by.
        "root": quantity("root", ExactOperation("sqrt", ("a",)), 0),
        "function": quantity("function", Sum(()), inherited_error=slopes),
        "steep": quantity("steep", Sum(()), inherited_error=replace(slopes, most=one / 8)),
    }
    moves = _moves(Quantities(items), {"x": one / 16})
    expected = {"a": 1 / 16, "b": 0, "double": 5 / 32, "root": 1 / 4, "function": 3 / 16, "steep": 1 / 8}
    assert {name: float(move) for name, move in moves.items()} == pytest.approx(expected, rel=1e-12)
    # A jump moves by all there is as soon as its argument moves at all.
    assert _moves(Quantities(items), {"z": one / 999})["function"] == 5


def test_distance_from_identity_is_offset_plus_stored_value():
    items = {
        "t_x": quantity("t_x", Sum(()), Fraction(-1, 8), Fraction(1, 4)),
        "t_s": replace(quantity("t_s", Sum(()), Fraction(-1, 16), 0), offset=Fraction(3, 4)),
    }
    context = SimpleNamespace(
        quantities=Quantities(items, {"transition": ("t_x", "t_s", Fraction(1, 3))}),
        program=SimpleNamespace(
            attitude_step=SimpleNamespace(identity=(Fraction(0), Fraction(1), Fraction(0)))
        ),
    )
    result = SimpleNamespace(signal=SimpleNamespace(name="transition"))
    assert _away(context, result) == (Fraction(1, 4), Fraction(5, 16), Fraction(1, 3))


# A run in the plane, whose transitions turn: the worst that errors of stated sizes can do, from the recurrence alone


ANGLE, STEPS, LENGTH = 0.05, 400, 1.25
AWAY = 2 * math.sin(ANGLE / 2)


def reached(sign, local=0.0, transition=0.0, state_feedback=0.0, transition_feedback=0.0) -> float:
    """Return the largest error after a run x' = x (T + d) + r from which d and r are left out.

    The transition turns by an angle in one direction, or to and fro for a sign of -1. Errors d and r are free up to
    their size, beside the differences of what was fed back before and what is fed back now, which are free too. The
    error is linear in each of them, but for the product of both feedbacks, for which the state is fed back to and fro.
    """
    turns = [cmath.exp(1j * ANGLE * sign**k) for k in range(STEPS)]
    after = [1 + 0j] * (STEPS + 1)  # the product of all transitions behind a step
    for k in reversed(range(STEPS)):
        after[k] = after[k + 1] * turns[k]
    fed = [state_feedback * (-1) ** k for k in range(STEPS + 1)] if sign < 0 else [0.0] * (STEPS + 1)
    states = [LENGTH + 0j]
    for k, turn in enumerate(turns):
        states.append(states[-1] * turn + fed[k] - fed[k + 1])
    total = sum(local + abs(states[k]) * transition for k in range(STEPS))
    # The coefficient of what is fed back from step k - 1 to step k, of the state and of the transition.
    of_state = [after[1]] + [after[k + 1] - after[k] for k in range(1, STEPS)] + [after[STEPS]]
    products = [after[k + 1] * states[k] for k in range(STEPS)]
    of_transition = [products[0]] + [products[k] - products[k - 1] for k in range(1, STEPS)] + [products[-1]]
    total += state_feedback * sum(map(abs, of_state))
    return total + transition_feedback * sum(map(abs, of_transition))


def planar(carry: str = "full"):
    """Return a walk of a step in the plane that turns."""
    state = Signal("state", (2,), ("s_1", "s_2"), bound=1)
    one = Interval.symmetric(Fraction(LENGTH) / Fraction(math.sqrt(2)))
    items = {name: Quantity(name, InputElement("state"), Fraction(0), one) for name in state.elements}
    program = SimpleNamespace(inputs=(state,), attitude_step=SimpleNamespace(isometry=True))
    settings = SimpleNamespace(carry=carry)
    return SimpleNamespace(quantities=Quantities(items), program=program, settings=settings)


def sized(
    local=0, transition=0, state_feedback=0, transition_feedback=0, away=0, moves=0, saturation=0
) -> StepErrors:
    """Return errors of these lengths; what is fed back of the state has its size in each of two elements."""
    part = Fraction(state_feedback) / Fraction(math.sqrt(2))
    lengths = (local, transition, transition_feedback, away, moves)
    first, second, third, fourth, fifth = ((Fraction(x) * 3 / 5, Fraction(x) * 4 / 5) for x in lengths)
    return StepErrors(first, second, third, part, fourth, fifth, Fraction(saturation))


@pytest.mark.parametrize("sign", [1, -1], ids=["one way", "to and fro"])
@pytest.mark.parametrize(
    "sizes",
    [
        {"local": 1e-6},
        {"transition": 1e-6},
        {"state_feedback": 1e-6},
        {"transition_feedback": 1e-6},
        {"local": 1e-6, "transition": 3e-6, "state_feedback": 2e-6, "transition_feedback": 1e-7},
    ],
    ids=lambda sizes: " ".join(sizes),
)
def test_adversary_reaches_the_bound_of_a_run(sizes, sign):
    told = accumulation(planar(), None, sized(**sizes, away=AWAY))
    bound = float(told.once + STEPS * told.per_step)
    worst = reached(sign, **sizes)
    assert told.growth == 1
    assert worst <= bound * (1 + 1e-5)  # the state is longer by what is added to it
    # Feedback of the transition is worst where it turns to and fro, and half as bad where it turns one way.
    if "transition_feedback" not in sizes or sign < 0:
        assert bound <= worst * (1.02 if len(sizes) == 1 else 1.2)


def test_state_feedback_moves_transition_feedback(monkeypatch):
    monkeypatch.setitem(globals(), "ANGLE", 0.0)  # then nothing else does, behind the first and the last step
    sizes = {"state_feedback": 0.01, "transition_feedback": 0.02}
    told = accumulation(planar(), None, sized(**sizes))
    worst = reached(-1, **sizes)
    assert worst == pytest.approx(float(told.once + (STEPS - 1) * told.per_step), rel=2e-3)
    assert float(told.per_step) == pytest.approx(2 * 0.01 * 0.02)


def test_the_first_state_and_every_step_may_saturate_and_rounded_increments_move_a_state_of_full_length():
    told = accumulation(planar(), None, sized(saturation=Fraction(1, 64), local=Fraction(1, 32)))
    assert float(told.once) == 1 / 64
    assert float(told.per_step) == pytest.approx(1 / 64 + 1 / 32)
    moved = accumulation(planar(), None, sized(moves=Fraction(1, 32)))
    assert float(moved.input_rounding) == pytest.approx(LENGTH / 32)
    assert moved.per_step == 0
    # Without error feedback nothing is fed back.
    assert accumulation(planar("none"), None, sized(state_feedback=1, away=1)).once == 0


def test_of_a_matrix_the_longest_row_counts():
    names = tuple(f"s_{k}" for k in range(9))
    state = Signal("state", (3, 3), names, bound=1)
    items = {
        name: Quantity(name, InputElement("state"), Fraction(0), Interval.symmetric(1)) for name in names
    }
    context = planar()
    context.quantities, context.program.inputs = Quantities(items), (state,)
    rows = tuple(map(Fraction, (1, 0, 0, 0, 3, 4, 0, 1, 0)))
    zeros, zero = (Fraction(0),) * 9, Fraction(0)
    told = accumulation(context, None, StepErrors(rows, zeros, zeros, zero, zeros, zeros))
    assert float(told.per_step) == 5
    # A row of three elements of 1 meets the whole error of the transition.
    told = accumulation(context, None, StepErrors(zeros, rows, zeros, zero, zeros, zeros))
    assert float(told.per_step) == pytest.approx(math.sqrt(3 * 27))


# What one call adds, from the code that it runs


def behind_transition(code: Program, values: dict[str, Fraction]) -> list[Fraction]:
    """Return the outputs of a step on numbers, among which are those of the transition."""
    known = dict(values)

    def value(node):
        if isinstance(node, Constant):
            return node.value
        return (
            known[node.name]
            if isinstance(node, Reference)
            else OPERATIONS[node.kind](*map(value, node.arguments))
        )

    for assignment in code.body:
        known.setdefault(assignment.name, value(assignment.value))
    return [value(node) for node in code.outputs[0].nodes]


@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_error_beside_the_feedback_is_reported(algorithm, rounding, rng):
    """The transition, and the state of the computed transition, less what is fed back of them, are off by so little."""
    code, settings = program(Choice(algorithm, "rk2", 2)), Settings(12, rounding=rounding, carry="full")
    exact, plan = _plan(code, settings)
    context = _walk(code, settings, exact, plan, {})
    result = quantized(Choice(algorithm, "rk2", 2), settings).interface.outputs[0]
    errors = step_errors(context, code.transition, result)
    after = exact.results[code.outputs[0].signal.name]
    names = [node.name for node in code.transition.nodes]
    worst = {key: [Fraction(0)] * len(after) for key in ("transition", "local")}
    for _ in range(30):
        integers, numbers, fed = {}, {}, {}
        for argument in context.plan.inputs:
            for name in argument.signal.elements:
                integers[name] = int(rng.integers(argument.low, argument.high + 1))
                numbers[name] = integers[name] * argument.format.unit
        integers |= {name: int(rng.integers(0, 1 << 12)) for name in context.feedback_names.values()}
        for value in context.body:
            definition = value.definition
            if isinstance(definition, IntegerSum) and (left := definition.residual) is not None:
                rest = (with_feedback(definition, integers) << -left.shift) & 4095
                fed[value.name] = (integers[left.name] - rest) * Fraction(2) ** -left.fraction
            integers[value.name], _ = computed(definition, integers, rounding == "nearest")
        stored = {n: integers[n] * Fraction(2) ** -v.fraction + v.offset for n, v in context.values.items()}
        (wanted,) = code.transition_program().run(numbers).values()
        now = behind_transition(code, numbers | {name: stored[name] for name in names})
        lacks = {
            "transition": [stored[n] - w - fed.get(n, 0) for n, w in zip(names, wanted, strict=True)],
            "local": [stored[n] - w - fed.get(n, 0) for n, w in zip(after, now, strict=True)],
        }
        for key, row in lacks.items():
            worst[key] = [max(abs(a), b) for a, b in zip(row, worst[key], strict=True)]
    for key, bounds in (("transition", errors.transition), ("local", errors.local)):
        for measured, bound in zip(worst[key], bounds, strict=True):
            assert measured <= bound <= 64 * measured, key
    rounded = context.rounding_error
    assert errors.state_feedback == rounded * result.format.unit
    assert errors.transition_feedback == tuple(
        rounded / 2 ** context.values[name].fraction if name in fed else 0 for name in names
    )


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_rounded_increments_move_the_transition_by_the_stated_amount(algorithm):
    code, settings = program(Choice(algorithm, "rk2", 2)), Settings(12)
    exact, plan = _plan(code, settings)
    context = _walk(code, settings, exact, plan, {})
    result = quantized(Choice(algorithm, "rk2", 2), settings).interface.outputs[0]
    errors = step_errors(context, code.transition, result)
    part, argument = code.transition_program(), plan.inputs[1]
    names, farthest = argument.signal.elements, [Fraction(0)] * len(errors.moves)
    for signs in product((-1, 1), repeat=len(names)):
        corner = dict(zip(names, signs, strict=True))
        ends = [
            part.run(
                {name: sign * (argument.high * argument.format.unit - less) for name, sign in corner.items()}
            )
            for less in (0, argument.format.unit / 2)
        ]
        (one,), (other,) = (row.values() for row in ends)
        farthest = [max(known, abs(a - b)) for known, a, b in zip(farthest, one, other, strict=True)]
    for measured, bound in zip(farthest, errors.moves, strict=True):
        assert measured <= bound <= Fraction(9, 4) * measured
    # Terms of higher order cancel in part; what is linear in the increments does not.
    least = min(bound / measured for measured, bound in zip(farthest, errors.moves, strict=True))
    assert least < Fraction(3, 2)


def test_a_state_that_saturates_loses_a_unit_of_its_last_place():
    fixed = quantized(Choice("euler", "rk2", 2), Settings(16, state="q15"))
    told, unit = fixed.interface.accumulation, Fraction(1, 1 << 15)
    assert told.once == unit
    assert told.per_step > unit


def test_a_transition_of_which_no_stretch_is_known_stretches_by_its_distance_from_the_identity(monkeypatch):
    monkeypatch.setattr("strapgen.fixedpoint.accumulation.stretch", lambda *_: None)
    far = (Fraction(3, 8), Fraction(1, 2))
    monkeypatch.setattr("strapgen.fixedpoint.accumulation._away", lambda *_: far)
    assert float(accumulation(planar(), None, sized()).growth) == pytest.approx(1 + 5 / 8, rel=1e-12)


def test_growth_is_the_largest_singular_value_of_a_transition():
    """Of [[1, x], [x, 1]] it is 1 + x, of [[1, x], [-x, 1]] the root of 1 + x^2."""
    x = Signal("increments", (1,), ("x",), bound=Fraction(1, 8))
    one, up, down = Constant(Fraction(1)), Reference("x"), Operation("negate", (Reference("x"),))
    s = Signal("state", (2,), ("s_1", "s_2"), bound=1)
    for second, expected in ((up, 9 / 8), (down, math.sqrt(65 / 64))):
        body = (
            Assignment("a", Operation("add", (up, Constant(Fraction(0))))),
            Assignment("b", Operation("add", (second, Constant(Fraction(0))))),
        )
        nodes = (one, Reference("a"), Reference("b"), one)
        transition = Result(Signal("transition", (2, 2), ("t1", "t2", "t3", "t4")), nodes)
        step = Program(KernelInfo("made", "", ""), (s, x), body, (), transition)
        growth = transition_growth(step, transition, (Fraction(1, 8),), 2, Fraction(7))
        assert float(growth) == pytest.approx(expected, rel=1e-12)
    calls = replace(step, body=(*body[:1], Assignment("b", Operation("sqrt", (Reference("x"),)))))
    assert transition_growth(calls, transition, (Fraction(1, 8),), 2, Fraction(7)) == 7


LIMIT, FAR = Fraction(1, 8), Fraction(1000)


def bounds(step: Program, limit: Fraction = LIMIT, known: Fraction = FAR) -> Interval:
    sizes = (limit,) * step.inputs[1].size
    width = step.inputs[0].shape[-1]
    assert step.transition is not None
    return singular_value_bounds(step, step.transition, sizes, width, known)


def stretches_reached(step: Program, vectors: np.ndarray) -> np.ndarray:
    """Return the squared singular values less 1 of the transitions of increments, shape (elements, count)."""
    part = step.transition_program()
    names = [name for signal in part.inputs for name in signal.elements]
    (elements,) = part.run(dict(zip(names, vectors, strict=True)), float).values()
    elements = np.array(np.broadcast_arrays(*elements))
    if len(elements) == 4:
        return np.square(elements).sum(axis=0) - 1
    matrices = np.moveaxis(elements.reshape(3, 3, -1), -1, 0)
    return np.square(np.linalg.svd(matrices, compute_uv=False)) - 1


@pytest.mark.parametrize("method", ["rk2", "rk3", "rk4"])
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_bounds_of_two_increments_hold_and_are_nearly_reached_in_the_ball_about_the_box(
    algorithm, method, rng
):
    step = program(choose_step(algorithm, method, 2))
    vectors = rng.normal(size=(2, 3, 30_000))
    vectors[:, :, :10_000] = vectors[:, :, :1].repeat(10_000, axis=2) * rng.choice([-1, 1], (2, 1, 10_000))
    vectors[1, :, 10_000:20_000] = rng.normal(size=(10_000)) * vectors[0, :, 10_000:20_000]
    vectors *= float(LIMIT) * math.sqrt(3) / np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors[0, :, ::7] = 0
    excess = stretches_reached(step, vectors.reshape(6, -1))
    proved = bounds(step)
    assert float(proved.lowest) <= excess.min()
    assert excess.max() <= float(proved.highest)
    if (algorithm, method) != ("dcm", "rk2"):  # its least singular value is near 1, and the bound coarse
        assert float(proved.lowest) >= 1.1 * min(excess.min(), 0) - 1e-9
    assert float(proved.highest) <= 1.1 * max(excess.max(), 0) + 1e-9


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_bounds_of_one_increment_are_those_of_an_angle(algorithm):
    """A rotation by Runge and Kutta's series in an angle t has length 1 - t^6/72 + t^8/576, of half of it for Euler."""
    step = program(choose_step(algorithm, "rk4", 1))
    angle = float(LIMIT) * math.sqrt(3) / (2 if algorithm == "euler" else 1)
    proved = bounds(step)
    lowest = -(angle**6) / 72 + angle**8 / 576
    assert 1.04 * lowest <= float(proved.lowest) <= lowest
    assert 0 <= float(proved.highest) < 1e-12


def test_a_coarser_bound_counts_where_no_closer_one_is_proved(monkeypatch):
    step = program(choose_step("euler", "rk4", 2))
    known = Fraction(1, 10**9)
    assert bounds(step, known=known) == Interval.symmetric(known)
    three = program(choose_step("euler", "rk4", 3))
    assert bounds(three, known=known) == Interval.symmetric(known)
    assert singular_value_bounds(step, step.transition, (), 4, FAR) == Interval.symmetric(FAR)
    monkeypatch.setattr(accumulation_module, "_MOST_PRODUCTS", 10)
    assert bounds(step) == Interval.symmetric(FAR)


def with_first(step: Program, change) -> Program:
    """Return a step with another first element of the transition."""
    assert step.transition is not None
    first, *others = step.transition.nodes
    return replace(step, transition=replace(step.transition, nodes=(change(first), *others)))


@pytest.mark.parametrize(
    "change",
    [
        lambda node: Operation("negate", (node,)),  # turns backwards about one axis
        lambda node: Operation("sqrt", (node,)),  # no polynomial
    ],
)
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_a_transition_that_does_not_turn_with_its_increments_has_the_coarser_bound(algorithm, change):
    step = with_first(program(choose_step(algorithm, "rk2", 2)), change)
    assert bounds(step) == Interval.symmetric(FAR)


def test_a_matrix_turns_with_its_vectors_if_its_rows_and_its_columns_do():
    """The transposed matrix does too; one with a row multiplied does not."""
    step = program(choose_step("dcm", "rk2", 2))
    elements = accumulation_module._polynomials(step, step.transition)
    assert accumulation_module._turns_with_vectors(elements)
    assert accumulation_module._turns_with_vectors([elements[3 * (k % 3) + k // 3] for k in range(9)])
    doubled = [{m: 2 * c for m, c in p.items()} if k < 3 else p for k, p in enumerate(elements)]
    assert not accumulation_module._turns_with_vectors(doubled)
    assert not accumulation_module._turns_with_vectors([*elements[3:], *elements[:3]])


def test_a_quaternion_turns_with_its_vectors_if_its_scalar_stays():
    step = program(choose_step("euler", "rk2", 2))
    elements = accumulation_module._polynomials(step, step.transition)
    assert accumulation_module._turns_with_vectors(elements)
    assert not accumulation_module._turns_with_vectors([*elements[:3], elements[0]])
    assert not accumulation_module._turns_with_vectors([elements[1], elements[0], *elements[2:]])


@pytest.mark.parametrize("longer", [0, 1])
def test_either_increment_may_be_the_longer_one(longer, monkeypatch):
    """A scalar of 1 and the difference of two squared lengths is largest where one of them is zero."""
    step = program(choose_step("euler", "rk4", 2))
    scalar = {(): Fraction(1)}
    for vector, axis in product(range(2), range(3)):
        scalar[(vector, axis), (vector, axis)] = Fraction(1 if vector == longer else -1)
    monkeypatch.setattr(accumulation_module, "_polynomials", lambda *_: [{}, {}, {}, scalar])
    most = 3 * float(LIMIT) ** 2
    proved = bounds(step)
    assert (1 + most) ** 2 - 1 <= float(proved.highest) <= 1.04 * ((1 + most) ** 2 - 1)
    assert 1.04 * ((1 - most) ** 2 - 1) <= float(proved.lowest) <= (1 - most) ** 2 - 1


# What the header states of it


def adverse_increments(algorithm: str, steps: int) -> np.ndarray:
    """Return increments at corners of their box, shape (steps, 2, 3), each of which stretches the state most.

    Of a matrix it is the first row, whose transition multiplies from the right.
    """
    part = program(choose_step(algorithm, "rk4", 2)).transition_program()
    names = [name for signal in part.inputs for name in signal.elements]
    corners = np.array(np.meshgrid(*[[-0.125, 0.125]] * 6)).reshape(6, -1)
    (elements,) = part.run(dict(zip(names, corners, strict=True)), float).values()
    elements = np.array(np.broadcast_arrays(*elements))
    if algorithm == "euler":
        best = np.square(elements).sum(axis=0).argmax()
        return np.repeat(corners[:, best].reshape(1, 2, 3), steps, axis=0)
    matrices = np.moveaxis(elements.reshape(3, 3, -1), -1, 0)
    row, chosen = np.array([1.0, 0, 0]), []
    for _ in range(steps):
        products = row @ matrices
        chosen.append(np.square(products).sum(axis=1).argmax())
        row = products[chosen[-1]]
    return corners[:, chosen].T.reshape(steps, 2, 3)


@pytest.mark.parametrize(("algorithm", "stated"), [("euler", 1900), ("dcm", 120)])
def test_no_call_is_refused_before_the_stated_number_and_one_is_soon_after(algorithm, stated):
    """What is left between both is the corner of the box that the ball about it does not reach, and 3 %."""
    backend = strapgen.backend(algorithm, "rk4", 2, "c-fixed32", settings=Settings())
    interface = backend.interface
    calls = interface.accumulation.calls_within(interface.settings.allowance)
    assert calls > stated
    increments = adverse_increments(algorithm, calls * 4 // 3)
    backend.propagate(increments[:calls])
    with pytest.raises(strapgen.InputError, match="refuses its input in step"):
        backend.propagate(increments)


def test_only_parts_beyond_the_disc_are_left_out():
    """The second vector is no longer than the first: a part counts if its corner nearest to the origin is inside."""
    side = 1 / 64
    for k, m in product(range(64), repeat=2):
        cube = ((0.0, side), (k * side, (k + 1) * side), (m * side, (m + 1) * side))
        assert accumulation_module._is_outside(cube) == (k * k + m * m > 64 * 64)
