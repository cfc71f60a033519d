"""Described systems, as `simulate` and `compare` run them."""

from __future__ import annotations

from typing import Any

from strapgen.lab.run_options import DescribedAlgorithms
from strapgen.navigation.systems.built_in import is_system


def _simulate(*arguments: Any) -> None:
    from strapgen.navigation.systems.simulate_system import simulated_system

    simulated_system(*arguments)


def _compare(*arguments: Any) -> None:
    from strapgen.navigation.systems.compare_system import compared_system

    compared_system(*arguments)


SYSTEMS = DescribedAlgorithms(is_system, _simulate, _compare)
