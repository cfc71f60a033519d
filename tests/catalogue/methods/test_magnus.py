"""Magnus series: their order on any rate, the published coning correction, and that a step is a rotation."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from strapgen import derive
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, evaluate_stages

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long


def rotation_vector(kernel: Kernel) -> list:
    """Return the rotation vector of a step as polynomials in the elements of its increments, and these."""
    names = kernel.inputs[1].elements
    ring, *generators = sp.ring(names, sp.QQ)
    place = next(k for k, stage in enumerate(kernel.stages) if stage.signal.name == "phi")
    known = evaluate_stages(kernel.stages[: place + 1], dict(zip(names, generators, strict=True)))
    vectors = np.array(generators, object).reshape(-1, 3)
    return [ring(known[f"phi_{axis}"]) for axis in "xyz"], vectors


def test_the_published_coning_correction_of_two_increments():
    # J. W. Jordan, NASA TN D-5384 (1969); R. B. Miller, J. Guid. Control Dyn. 6 (1983) 287: 2/3 of the cross product.
    found, (d1, d2) = rotation_vector(derive("euler", "magnus4", 2))
    cross = algebra.cross_elements(list(d1), list(d2))
    assert found == [a + b + sp.Rational(2, 3) * c for a, b, c in zip(d1, d2, cross, strict=True)]


def test_the_published_coning_correction_with_one_previous_increment():
    # 1/12 of the previous increment times the present one: the two-sample algorithm of a slow gyro (Jordan 1969).
    found, (past, d) = rotation_vector(derive("euler", "magnus4", 1, previous=1))
    cross = algebra.cross_elements(list(past), list(d))
    assert found == [a + sp.Rational(1, 12) * c for a, c in zip(d, cross, strict=True)]


# The transition is a rotation
