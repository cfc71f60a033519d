"""Bounds of eigenvalues in Bernstein form hold, and come near values that are reached."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from strapgen.kernel import bernstein
from strapgen.kernel.bernstein import eigenvalue_bounds

ONE, FAR = Fraction(1), Fraction(1000)
CORNERS = np.array([[x, y] for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0)])


def near(bounds: tuple[Fraction, Fraction], low: float, high: float) -> bool:
    """Tell whether bounds hold, and lie within a thirtieth of the extremes."""
    return 1.04 * low - 1e-9 <= bounds[0] <= low and high <= bounds[1] <= 1.04 * high + 1e-9


@pytest.mark.parametrize(
    ("polynomial", "low", "high"),
    [
        ({(1, 1): ONE}, 0, 1),
        ({(2, 0): ONE, (1, 0): -ONE}, -0.25, 0),  # x^2 - x
        ({(0, 0): ONE / 3}, 0, 1 / 3),
        ({(0, 0): -ONE / 3}, -1 / 3, 0),
    ],
    ids=str,
)
def test_bounds_of_a_polynomial_lie_near_its_extremes_and_about_zero(polynomial, low, high):
    bounds = eigenvalue_bounds([[[polynomial]]], CORNERS, FAR)
    assert bounds[0] <= 0 <= bounds[1]
    assert near(bounds, low, high)


def test_a_polynomial_that_touches_zero_along_a_line_has_a_bound_near_zero():
    square = {(2, 0): ONE, (1, 1): -2 * ONE, (0, 2): ONE}  # (x - y)^2
    low, high = eigenvalue_bounds([[[square]]], CORNERS, FAR)
    assert -1 / 2000 <= low <= 0
    assert near((Fraction(0), high), 0, 1)


def test_bounds_of_a_matrix_hold_where_no_sample_lies(rng):
    """A bound follows from the coefficients: samples that miss the extremes make it no smaller than it is."""
    powers = [(i, j) for i in range(4) for j in range(4)]
    drawn = rng.integers(-9, 10, (6, len(powers)))
    upper = iter([dict(zip(powers, map(Fraction, map(int, row)), strict=True)) for row in drawn])
    elements = {(i, j): next(upper) for i in range(3) for j in range(i, 3)}
    matrix = [[elements[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]
    grid = np.linspace(0, 1, 41)
    x, y = np.meshgrid(grid, grid)
    values = np.array(
        [[sum(float(c) * x**i * y**j for (i, j), c in p.items()) for p in row] for row in matrix]
    )
    eigenvalues = np.linalg.eigvalsh(np.moveaxis(values, (0, 1), (-2, -1)))
    low, high = min(0.0, eigenvalues.min()), max(0.0, eigenvalues.max())
    samples = np.stack([x.ravel(), y.ravel()], axis=1)
    assert near(eigenvalue_bounds([matrix], samples, FAR), low, high)
    hidden = eigenvalue_bounds([matrix], np.array([[0.0, 0.0]]), FAR)
    assert hidden[0] <= low
    assert high <= hidden[1]


def test_a_bound_need_not_hold_outside():
    x = {(1, 0): ONE}
    inside = np.array([[0.5, 0.0]])
    low, high = eigenvalue_bounds([[[x]]], inside, FAR, lambda cube: cube[0][0] >= ONE / 2)
    assert -1e-9 < low <= 0
    assert 0.5 <= high < 0.52
    assert eigenvalue_bounds([[[x]]], inside, FAR)[1] >= 1


def test_the_largest_of_several_matrices_counts():
    small, large = [[{(1,): ONE / 8}]], [[{(2,): -ONE}]]
    low, high = eigenvalue_bounds([small, large], np.array([[1.0]]), FAR)
    assert near((low, high), -1, 1 / 8)


def test_known_bound_is_returned_without_a_closer_proof(monkeypatch):
    x = [[{(1,): ONE}]]
    assert eigenvalue_bounds([x], np.array([[1.0]]), ONE) == (pytest.approx(0, abs=1e-9), 1)
    monkeypatch.setattr(bernstein, "_MOST_CUBES", 0)
    assert eigenvalue_bounds([x], np.array([[1.0]]), FAR) == (-FAR, FAR)


def test_a_matrix_of_zeros_has_no_other_eigenvalues():
    assert eigenvalue_bounds([[[{}, {}], [{}, {}]]], np.array([[1.0]]), FAR) == (0, 0)


def test_coefficients_are_rounded_down_and_their_slack_counts():
    """Halving rounds every mean down: the limit must exceed what the true coefficients may be."""
    forms = bernstein._BernsteinForms(np.array([[[3, 4, 4]]]), [((Fraction(0), ONE),)], 0)
    halves = forms.halves()
    assert halves.coefficients.tolist() == [[[3, 3, 3]], [[3, 4, 4]]]  # 3, 7/2, 15/4 and 15/4, 4, 4
    assert halves.cubes == [((0, ONE / 2),), ((ONE / 2, ONE),)]
    assert halves.slack >= 1


def test_of_several_variables_the_longest_is_cut_and_parts_stay_apart():
    numbers = np.arange(12).reshape(2, 1, 2, 3)
    cubes = [((Fraction(0), ONE / 2), (low, low + ONE / 2)) for low in (Fraction(0), ONE / 2)]
    halves = bernstein._BernsteinForms(numbers, cubes, 0).halves()
    assert [cube[1] for cube in halves.cubes] == [(k * ONE / 4, (k + 1) * ONE / 4) for k in (0, 2, 1, 3)]
    assert {cube[0] for cube in halves.cubes} == {(0, ONE / 2)}
    assert halves.coefficients[:2, 0, :, 0].tolist() == numbers[:, 0, :, 0].tolist()
    assert halves.coefficients[2:, 0, :, 2].tolist() == numbers[:, 0, :, 2].tolist()


def test_limit_exceeds_coefficients_by_slack_and_rounding():
    """Rounding in double needs 2^-45 of what a coefficient of 2^50 lacks: 32 units, and one."""
    whole = [((Fraction(0), ONE),)]
    forms = bernstein._BernsteinForms(np.array([[[1000, -1000]], [[999, 999]]]), 2 * whole, 100)
    assert forms.are_below(1000 + 100 + 33).tolist() == [False, True]
    assert forms.are_below(1000 + 100 + 34).tolist() == [True, True]


def test_a_limit_exceeds_all_eigenvalues_of_a_matrix(rng):
    """A coefficient counts as below if and only if its largest eigenvalue is, away from what rounding needs."""
    matrices = rng.integers(-(1 << 49), 1 << 49, (40, 4, 4))
    matrices = np.triu(matrices) + np.swapaxes(np.triu(matrices, 1), 1, 2)
    rows, columns = np.triu_indices(4)
    forms = bernstein._BernsteinForms(matrices[:, rows, columns][..., None], 40 * [((Fraction(0), ONE),)], 0)
    for limit in (1 << 49, 1 << 50):
        assert (
            forms.are_below(limit).tolist()
            == (np.linalg.eigvalsh(matrices.astype(float)).max(axis=1) < limit).tolist()
        )
