"""Bounds of the singular values of transitions hold, and come near values that are reached."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from derived import program

import strapgen
from strapgen.catalogue import choose_step
from strapgen.fixedpoint import accumulation
from strapgen.fixedpoint.accumulation import singular_value_bounds
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Operation, Program

LIMIT, FAR = Fraction(1, 8), Fraction(1000)


def bounds(step: Program, limit: Fraction = LIMIT, known: Fraction = FAR) -> Interval:
    sizes = (limit,) * step.inputs[1].size
    width = step.inputs[0].shape[-1]
    assert step.transition is not None
    return singular_value_bounds(step, step.transition, sizes, width, known)


def reached(step: Program, vectors: np.ndarray) -> np.ndarray:
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
    excess = reached(step, vectors.reshape(6, -1))
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
    monkeypatch.setattr(accumulation, "_MOST_PRODUCTS", 10)
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
    elements = accumulation._polynomials(step, step.transition)
    assert accumulation._turns_with_vectors(elements)
    assert accumulation._turns_with_vectors([elements[3 * (k % 3) + k // 3] for k in range(9)])
    doubled = [{m: 2 * c for m, c in p.items()} if k < 3 else p for k, p in enumerate(elements)]
    assert not accumulation._turns_with_vectors(doubled)
    assert not accumulation._turns_with_vectors([*elements[3:], *elements[:3]])


def test_a_quaternion_turns_with_its_vectors_if_its_scalar_stays():
    step = program(choose_step("euler", "rk2", 2))
    elements = accumulation._polynomials(step, step.transition)
    assert accumulation._turns_with_vectors(elements)
    assert not accumulation._turns_with_vectors([*elements[:3], elements[0]])
    assert not accumulation._turns_with_vectors([elements[1], elements[0], *elements[2:]])


@pytest.mark.parametrize("longer", [0, 1])
def test_either_increment_may_be_the_longer_one(longer, monkeypatch):
    """A scalar of 1 and the difference of two squared lengths is largest where one of them is zero."""
    step = program(choose_step("euler", "rk4", 2))
    scalar = {(): Fraction(1)}
    for vector, axis in product(range(2), range(3)):
        scalar[(vector, axis), (vector, axis)] = Fraction(1 if vector == longer else -1)
    monkeypatch.setattr(accumulation, "_polynomials", lambda *_: [{}, {}, {}, scalar])
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
        assert accumulation._is_outside(cube) == (k * k + m * m > 64 * 64)
