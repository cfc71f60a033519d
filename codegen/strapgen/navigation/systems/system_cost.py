"""Measures on a microcontroller what the stages of a described system cost, for its budget."""

from __future__ import annotations

from strapgen.ir.exceptions import CompilerError
from strapgen.lab import cost as costs
from strapgen.navigation.systems.budget import Budget, budget
from strapgen.navigation.systems.fitting import Fitted


def measured_budget(fit: Fitted, cpu: str) -> Budget:
    """Return what a system needs, with the instructions of every stage on a processor."""
    (name,) = costs.processors(None, [cpu])
    counts = {}
    for stage, sources in fit.sources.items():
        try:
            one = costs.cost(sources, name)
        except CompilerError as error:
            raise CompilerError(f"stage {stage}: {error}") from None
        counts[stage] = one.executed, one.code_bytes, one.stack_bytes
    return budget(fit, counts, name)
