"""Samples of inputs: proper ones meet the constraint of their signal."""

from __future__ import annotations

import numpy as np
import pytest

from strapgen.fixedpoint.derived_sums import samples
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.signals import Signal


@pytest.mark.parametrize("size", [3, 4])
def test_proper_vectors_of_length_one_have_it(size):
    signal = Signal.labelled("direction", "u", "xyzs"[:size], constraint="unit")
    ranges = {name: Interval.of(-1, 1) for name in signal.elements}
    proper, anywhere = samples([signal], ranges)
    lengths, others = (sum(values[name] ** 2 for name in signal.elements) for values in (proper, anywhere))
    np.testing.assert_allclose(lengths, 1, atol=1e-14)
    assert others.max() == size


def test_proper_rotations_are_rotations():
    signal = Signal.matrix("attitude", "C", constraint="rotation")
    proper, _ = samples([signal], {name: Interval.of(-1, 1) for name in signal.elements})
    C = np.stack([proper[name] for name in signal.elements], axis=-1).reshape(-1, 3, 3)
    np.testing.assert_allclose(C @ np.swapaxes(C, -1, -2), np.broadcast_to(np.eye(3), C.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(C), 1, atol=1e-14)
