"""How long parameters stay in their format follows from the exact length of a transition."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
from derived import program

from strapgen.catalogue import choose, choose_step
from strapgen.evidence import state_lengths
from strapgen.evidence.collection import Subject
from strapgen.evidence.state_lengths import Stretch

flint = pytest.importorskip("flint")

EULER = choose_step("euler", "rk4", 2)
LIMIT = Fraction(1, 8)


@pytest.fixture(scope="module")
def stretch() -> Stretch:
    bounds = state_lengths.stretch_of(program(EULER).transition_program(), LIMIT)
    assert bounds is not None
    return bounds


@pytest.mark.long
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


@pytest.mark.long
def test_proved_steps_are_near_those_of_the_header(stretch):
    """The header's bound is a thirtieth above what samples reach, and FLINT's a hundredth above what it reaches."""
    subject = Subject(EULER)
    for compare in (state_lengths.in_format, state_lengths.is_proper):
        _, detail = compare(subject, stretch)
        proved, stated = (
            int(number.replace(",", "")) for number in re.findall(r"[\d,]*\d", detail.replace(" 1, ", " "))
        )
        assert stated <= proved <= 1.1 * stated


@pytest.mark.long
def test_singular_values_of_matrices_are_proved_too():
    subject = Subject(choose_step("dcm", "rk4", 2))
    bounds = state_lengths.stretch_of(subject.program.transition_program(), LIMIT)
    assert state_lengths.in_format(subject, bounds)[0] == "proved"
    assert state_lengths.is_proper(subject, bounds)[0] == "proved"
    wider = Stretch(2 * bounds.low, 2 * bounds.high)
    assert state_lengths.in_format(subject, wider)[0] == "fails"
    assert state_lengths.is_proper(subject, wider)[0] == "fails"


@pytest.mark.parametrize(("growth", "added"), [(0.0, 0.25), (0.01, 0.0), (0.01, 0.125), (1e-9, 0.5)])
@pytest.mark.parametrize("sign", [1, -1])
def test_steps_are_counted_until_a_number_is_passed(growth, added, sign):
    start, end = 8.0, 8.0 + 2 * sign
    x, count = start, 0
    while (x := (1 + sign * growth) * x + sign * added) * sign <= end * sign:
        count += 1
    assert state_lengths.steps_between(start, end, sign * growth, sign * added) in (count, count - 1)
    assert state_lengths.steps_between(end, start, sign * growth, sign * added) == 0


@pytest.mark.parametrize(
    "choice", [choose("euler-product"), choose_step("euler", "rk1", 3)], ids=lambda c: c.name
)
def test_other_kernels_have_no_claim(choice, tmp_path):
    assert state_lengths.check(Subject(choice), tmp_path) == []


def test_a_header_without_a_number_is_not_examined(tmp_path):
    verdicts = state_lengths.check(Subject(choose_step("euler", "rk1", 2)), tmp_path)
    assert [verdict.claim for verdict in verdicts] == ["state: stays in its format", "state: stays proper"]
    assert {verdict.result for verdict in verdicts} == {"not examined"}


PLANE = flint.fmpq_mpoly_ctx.get(["x", "y", "z"], flint.Ordering.lex)


def test_covariance_under_rotations_is_detected():
    d = flint.fmpq_mpoly_ctx.get([f"d{k}" for k in range(6)], flint.Ordering.lex).gens()
    dot = sum(d[k] * d[k + 3] for k in range(3))
    assert state_lengths.is_covariant([[dot**2 + 3 * dot]])
    assert not state_lengths.is_covariant([[dot + d[0] * d[3]]])
    products = [[d[i] * d[3 + j] + d[j] * d[3 + i] for j in range(3)] for i in range(3)]
    assert state_lengths.is_covariant(products)
    assert not state_lengths.is_covariant([[*products[0][:2], 2 * products[0][2]], *products[1:]])


@pytest.mark.long
def test_the_largest_eigenvalue_is_bounded_where_variables_may_lie():
    """They are x and z from 0 to 1 and y from -1 to 1, with y^2 + z^2 up to 1."""
    x, y, z = PLANE.gens()
    zero = PLANE.constant(0)

    def largest(*rows) -> Fraction:
        return state_lengths.eigenvalue_bound([[list(row) for row in rows]])

    assert 2 <= largest([x + z]) <= 2.05
    assert 1 <= largest([y**2 + z**2]) <= 1.1
    assert 0 <= largest([-(x**2)]) <= 1e-3
    assert 1 <= largest([zero, x * y], [x * y, zero]) <= 1.02  # eigenvalues x y and -x y
    assert 1 <= largest([x * z, zero], [zero, -x]) <= 1.05


def test_the_largest_of_several_matrices_counts():
    x, y, _ = PLANE.gens()
    assert 3 <= state_lengths.eigenvalue_bound([[[x]], [[3 * x * y]]]) <= 3.1


def test_a_matrix_of_polynomials_below_zero_has_the_bound_zero():
    """What is divided by a power of x is below zero up to x = 0."""
    x, y, z = PLANE.gens()
    assert state_lengths.eigenvalue_bound([[[-(x**4) * (1 + y * y + z)]]]) < 1e-100


def test_numbers_above_eigenvalues_are_above_them():
    matrix = flint.fmpq_mat([[0, 3], [3, 0]])
    assert 3 < state_lengths._above(matrix) < 3 + 1e-6
    assert state_lengths._above(flint.fmpq_mat(3, 3)) > 0
    third = flint.fmpq_mat([[flint.fmpq(1, 3)]])
    assert Fraction(1, 3) < Fraction(state_lengths._above(third)) < Fraction(1, 3) + Fraction(1, 10**6)
    for one, eigenvalue in ((third, flint.fmpq(1, 3)), (matrix, flint.fmpq(3))):
        tiny = flint.fmpq(1, 10**20)
        assert state_lengths._exceeds(eigenvalue + tiny, one) and not state_lengths._exceeds(eigenvalue, one)


def test_curvature_in_a_box_counts():
    """About the middle of the box, x^2 is 1/4 + (2 u + u^2)/4 for u from -1 to 1: the last term is a quarter."""
    x = PLANE.gens()[0]
    zero, box = PLANE.constant(0), ((Fraction(0), Fraction(1)),) * 3
    for matrix in ([[x**2]], [[zero, x**2], [x**2, zero]]):
        middle, above = state_lengths._eigenvalues(matrix, box)
        assert middle == pytest.approx(1 / 4)
        assert 1 <= above < 1 + 1e-6
