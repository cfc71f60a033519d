"""Runs that several tests of the analysis hold predictions against."""

from __future__ import annotations

from pathlib import Path

import pytest

from strapgen.lab.runs import simulate
from strapgen.run.backends import backend

DATA = Path(__file__).resolve().parents[1] / "data" / "algorithms"


@pytest.fixture
def own_algorithm():
    """Return the file of an algorithm as a user writes it."""
    return lambda name: DATA / f"{name}.py"


@pytest.fixture(scope="session")
def simulated():
    """Return what runs an algorithm as the thesis does: 180 s in steps of 1/8 s, recorded every 5 s."""

    def run(algorithm, method, profile, every):
        return simulate(backend(algorithm, method, 2, "numpy"), profile, "1/8", 180, every, 5)

    return run
