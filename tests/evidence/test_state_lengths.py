"""How long parameters stay in their format follows from the exact length of a transition."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from derived import program

from strapgen.catalogue import choose, choose_step
from strapgen.evidence import state_lengths
from strapgen.evidence.state_lengths import Stretch
from strapgen.evidence.subjects import Subject

flint = pytest.importorskip("flint")

EULER = choose_step("euler", "rk4", 2)
LIMIT = Fraction(1, 8)


@pytest.fixture(scope="module")
def stretch() -> Stretch:
    bounds = state_lengths.stretch_of(program(EULER).transition_program(), LIMIT)
    assert bounds is not None
    return bounds


def test_the_bounds_of_the_length_hold_and_come_near_values_that_are_reached(stretch):
    transition = program(EULER).transition_program()
    rng = np.random.default_rng(3)
    corners = rng.choice([-0.125, 0.0, 0.125], (4000, 6))
    names = [name for signal in transition.inputs for name in signal.elements]
    (elements,) = transition.run(dict(zip(names, corners.T, strict=True)), float).values()
    excess = sum(np.square(element) for element in elements) - 1
    assert float(stretch.low) <= excess.min() < 0.8 * float(stretch.low)
    assert 0.8 * float(stretch.high) < excess.max() <= float(stretch.high)


def test_the_headers_numbers_of_steps_are_proved(stretch):
    subject = Subject(EULER)
    assert state_lengths.in_format(subject, stretch)[0] == "proved"
    assert state_lengths.is_proper(subject, stretch)[0] == "proved"


def test_numbers_that_do_not_follow_from_the_length_are_not_proved(stretch):
    subject = Subject(EULER)
    wider = Stretch(8 * stretch.low, 8 * stretch.high)
    assert state_lengths.in_format(subject, wider)[0] == "fails"
    assert state_lengths.is_proper(subject, wider)[0] == "fails"


def test_rotations_of_vectors_together_change_lengths_and_products_alone():
    whole = flint.fmpq_mpoly_ctx.get([f"d{k}" for k in range(6)], flint.Ordering.lex)
    d = whole.gens()
    dot = sum(d[k] * d[k + 3] for k in range(3))
    assert state_lengths.turns_alone(dot**2 + 3 * dot)
    assert not state_lengths.turns_alone(dot + d[0] * d[3])
    assert not state_lengths.turns_alone(d[0] ** 2 + d[1] ** 2)


def test_the_largest_value_of_a_polynomial_is_bounded_where_it_may_lie():
    one = Fraction(1)
    assert 2 <= state_lengths.largest([((1, 0, 0), one), ((0, 0, 1), one)], one) <= 2.05  # x + z
    assert 1 <= state_lengths.largest([((0, 2, 0), one), ((0, 0, 2), one)], one) <= 1.1  # y^2 + z^2
    assert 0 <= state_lengths.largest([((2, 0, 0), -one)], one) <= 1e-3  # -x^2, whose other sides are cut too


@pytest.mark.parametrize(
    "choice", [choose("euler-product"), choose_step("dcm", "rk4", 2)], ids=lambda c: c.name
)
def test_other_kernels_have_no_claim(choice, tmp_path):
    assert state_lengths.check(Subject(choice), tmp_path) == []


def test_a_header_without_a_number_is_not_examined(tmp_path):
    verdicts = state_lengths.check(Subject(choose_step("euler", "rk1", 2)), tmp_path)
    assert [verdict.claim for verdict in verdicts] == ["state: stays in its format", "state: stays proper"]
    assert {verdict.result for verdict in verdicts} == {"not examined"}
