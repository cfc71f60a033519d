"""The least sum of weighted absolute errors: against a linear programme, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from strapgen.design.filters import exchange
from strapgen.design.filters.band_grid import BITS, REAL
from strapgen.design.filters.exchange import Answers
from strapgen.ir.exceptions import InputError


def integers(values) -> list[int]:
    return [round(float(value) * 2**60) << (BITS - 60) for value in values]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [1, 3, 8])
def test_the_sum_is_that_of_a_linear_programme(count, seed):
    rng = np.random.default_rng(seed)
    matrix, right, weights = rng.normal(size=(60, count)), rng.normal(size=60), rng.uniform(1e-6, 1, 60)
    answers = Answers([integers(column) for column in matrix.T], integers(right))
    solution = exchange.least_absolute(answers, [REAL.mpf(w) for w in weights])
    errors = np.abs(right - matrix @ np.array([float(x) for x in solution]))
    ones = np.eye(60)
    best = linprog(
        np.concatenate([np.zeros(count), weights]),
        A_ub=np.block([[-matrix, -ones], [matrix, -ones]]),
        b_ub=np.concatenate([-right, right]),
        bounds=[(None, None)] * count + [(0, None)] * 60,
    )
    # The tolerance of the programme is 1e-7 for each of its constraints.
    assert weights @ errors == pytest.approx(best.fun, abs=60 * 1e-7)
    # At a vertex as many errors as there are unknowns are zero, but for the rounding of the solution to double.
    assert (errors < 1e-12).sum() == count


def test_one_unknown_is_the_weighted_median():
    answers = Answers([integers([1] * 5)], integers([5, 1, 2, 9, 3]))
    (plain,) = exchange.least_absolute(answers, [1] * 5)
    (weighted,) = exchange.least_absolute(answers, [1, 1, 1, 5, 1])
    assert (float(plain), float(weighted)) == (3, 9)


def test_fewer_points_than_unknowns_are_refused():
    with pytest.raises(InputError, match="1 lines do not determine 2 coefficients"):
        exchange.least_absolute(Answers([integers([1]), integers([2])], integers([3])), [1])
