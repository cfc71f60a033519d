"""The basis in which a transition is written: the vectors that its outer products begin with."""

from __future__ import annotations

import pytest

from strapgen.kernel.polynomials import ONE
from strapgen.lowering.canonical.plan import _axes


@pytest.mark.parametrize(
    ("products", "axes"),
    [
        ([], []),
        ([(0,), (0, 1)], [0]),  # a pair may begin with either: the first
        ([(0, 1), (1, 2), (1, 3)], [1]),  # one vector begins all of them
        ([(0, 2), (0, 3), (1, 2), (1, 3), (1, 4)], [0, 1]),  # 1 begins most, and 0 the others
        ([(2, 2), (0, 2)], [2]),  # a square has no choice
        ([(2, 0, 1), (0, 2), (0, 1)], [0, 2]),  # nor the product of a vector and a cross product
    ],
)
def test_outer_products_begin_with_few_vectors(products, axes):
    assert _axes({product: ONE for product in products}) == axes
