"""Generates a described system: its stages, and the unit that stores, calls and runs them, in C or in Python."""

from __future__ import annotations

from collections.abc import Sequence

from strapgen.ir import checks
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.navigation.systems import system_c
from strapgen.navigation.systems import system_python as python
from strapgen.navigation.systems.fitting import Fitted, fitted
from strapgen.navigation.systems.wiring import Description
from strapgen.targets import TARGETS, system_targets


def unit(fit: Fitted, command: str, budget: Sequence[str] = ()) -> Sources:
    """Return the C of a system whose stages are generated, or its twin in Python."""
    system = fit.description.system
    head = system.title, command
    if TARGETS[fit.target].language == "Python":
        return python.whole(system, head, fit.sources, fit.arguments, budget)
    return system_c.whole(system, fit.name, head, fit.sources, fit.arguments, budget)


def sources(
    description: Description, target: str = "c", settings: Settings | None = None, command: str = ""
) -> Sources:
    """Return the C of a described system, or its twin in Python."""
    checks.choice("target", target, system_targets())
    return unit(fitted(description, target, settings), command)
