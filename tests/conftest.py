"""What the tests share: one fixture over all back ends, and one over all attitude algorithms."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import strapgen
from strapgen.backends import BACKENDS, Backend
from strapgen.catalogue import ALGORITHMS


@pytest.fixture(params=list(BACKENDS))
def backend_name(request: pytest.FixtureRequest) -> str:
    """Name of a back end: a test that asks for it runs on every one."""
    return str(request.param)


@pytest.fixture(params=list(ALGORITHMS))
def algorithm(request: pytest.FixtureRequest) -> str:
    """Name of an attitude algorithm: a test that asks for it runs on every one."""
    return str(request.param)


@pytest.fixture
def make(backend_name: str):
    """Make a back end of an attitude algorithm on the back end under test."""

    def make_backend(algorithm: str, method: str = "rk4", increments: int = 2, **rest: object) -> Backend:
        return strapgen.backend(algorithm, method, increments, backend_name, **rest)

    return make_backend


@pytest.fixture
def rng() -> Iterator[np.random.Generator]:
    """A generator of random numbers that gives the same ones each time."""
    yield np.random.default_rng(1969)
