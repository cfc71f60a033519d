"""The step from Legendre coefficients is the step of every window after its filters."""

from __future__ import annotations

import numpy as np
import pytest

import strapgen
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late.late_filters import LateFilters


@pytest.mark.long
@pytest.mark.parametrize("name", ["dcm", "euler"])
@pytest.mark.parametrize("previous", [0, 3, 5, 6])
def test_filters_before_it_give_the_step_of_each_window_of_a_family(name, previous):
    family = WINDOWS["window-3-3"]
    window = family.one_sided_with(6 - previous)
    backend = strapgen.backend(name, window.name)
    samples = np.random.default_rng(previous).uniform(-0.1, 0.1, (20, 7, 3))
    rows = np.array(LateFilters(family, calm_start=True).sets[previous], float)
    coefficients = np.moveaxis(rows @ samples, -2, 0)
    state = backend.step(backend.identity, samples[0])
    ours = strapgen.evaluator(f"{name}-legendre-4")(state, *coefficients)
    theirs = np.array([backend.step(state, each) for each in samples])
    # Some hundred operations on numbers up to 1.
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=3e-15)


@pytest.mark.long
def test_the_exact_rotation_is_that_of_the_window():
    family = WINDOWS["window-9-9"]
    backend = strapgen.backend("euler", family.name)
    samples = np.random.default_rng(9).uniform(-0.1, 0.1, (5, 19, 3))
    coefficients = np.moveaxis(np.array(family.filters, float) @ samples, -2, 0)
    ours = strapgen.evaluator("euler-legendre-exact-5")(backend.identity, *coefficients)
    theirs = np.array([backend.step(backend.identity, each) for each in samples])
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=3e-15)
