"""FLINT bounds eigenvalues of matrices of polynomials, and tells what rotations leave alone."""

from __future__ import annotations

from fractions import Fraction

import pytest

from strapgen.evidence import eigenvalues

flint = pytest.importorskip("flint")

PLANE = flint.fmpq_mpoly_ctx.get(["x", "y", "z"], flint.Ordering.lex)


def test_rotations_of_vectors_together_change_lengths_and_products_alone():
    whole = flint.fmpq_mpoly_ctx.get([f"d{k}" for k in range(6)], flint.Ordering.lex)
    d = whole.gens()
    dot = sum(d[k] * d[k + 3] for k in range(3))
    assert eigenvalues.turns_alone([[dot**2 + 3 * dot]])
    assert not eigenvalues.turns_alone([[dot + d[0] * d[3]]])
    assert not eigenvalues.turns_alone([[d[0] ** 2 + d[1] ** 2]])


def test_rotations_of_vectors_turn_their_products():
    whole = flint.fmpq_mpoly_ctx.get([f"d{k}" for k in range(6)], flint.Ordering.lex)
    d = whole.gens()
    products = [[d[i] * d[3 + j] + d[j] * d[3 + i] for j in range(3)] for i in range(3)]
    assert eigenvalues.turns_alone(products)
    assert not eigenvalues.turns_alone([[*products[0][:2], 2 * products[0][2]], *products[1:]])


@pytest.mark.long
def test_the_largest_eigenvalue_is_bounded_where_variables_may_lie():
    """They are x and z from 0 to 1 and y from -1 to 1, with y^2 + z^2 up to 1."""
    x, y, z = PLANE.gens()
    zero = PLANE.constant(0)

    def largest(*rows) -> Fraction:
        return eigenvalues.largest([[list(row) for row in rows]])

    assert 2 <= largest([x + z]) <= 2.05
    assert 1 <= largest([y**2 + z**2]) <= 1.1
    assert 0 <= largest([-(x**2)]) <= 1e-3
    assert 1 <= largest([zero, x * y], [x * y, zero]) <= 1.02  # eigenvalues x y and -x y
    assert 1 <= largest([x * z, zero], [zero, -x]) <= 1.05


def test_the_largest_of_several_matrices_counts():
    x, y, _ = PLANE.gens()
    assert 3 <= eigenvalues.largest([[[x]], [[3 * x * y]]]) <= 3.1


def test_a_matrix_of_polynomials_below_zero_has_the_bound_zero():
    """What is divided by a power of x is below zero up to x = 0."""
    x, y, z = PLANE.gens()
    assert eigenvalues.largest([[[-(x**4) * (1 + y * y + z)]]]) < 1e-100


def test_numbers_above_eigenvalues_are_above_them():
    matrix = flint.fmpq_mat([[0, 3], [3, 0]])
    assert 3 < eigenvalues._above(matrix) < 3 + 1e-6
    assert eigenvalues._above(flint.fmpq_mat(3, 3)) > 0
    third = flint.fmpq_mat([[flint.fmpq(1, 3)]])
    assert Fraction(1, 3) < Fraction(eigenvalues._above(third)) < Fraction(1, 3) + Fraction(1, 10**6)
    for one, eigenvalue in ((third, flint.fmpq(1, 3)), (matrix, flint.fmpq(3))):
        tiny = flint.fmpq(1, 10**20)
        assert eigenvalues._exceeds(eigenvalue + tiny, one) and not eigenvalues._exceeds(eigenvalue, one)


def test_what_is_curved_in_a_box_counts():
    """About the middle of the box, x^2 is 1/4 + (2 u + u^2)/4 for u from -1 to 1: the last term is a quarter."""
    x = PLANE.gens()[0]
    zero, box = PLANE.constant(0), ((Fraction(0), Fraction(1)),) * 3
    for matrix in ([[x**2]], [[zero, x**2], [x**2, zero]]):
        middle, above = eigenvalues._eigenvalues(matrix, box)
        assert middle == pytest.approx(1 / 4)
        assert 1 <= above < 1 + 1e-6
