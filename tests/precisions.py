"""What numbers a back end computes with, for tolerances that hold for every back end of a kind."""

from __future__ import annotations

from strapgen.run.backends import BACKENDS
from strapgen.targets.registry import BUILT_IN


def precision(backend: str) -> str:
    """Return "double", "float" or "exact", or the bits of a word in fixed point; the model has words of 32 bits."""
    entry = BACKENDS[backend]
    if entry.fixed:
        return str(entry.word or 32)
    return "exact" if entry.many_digits else BUILT_IN[entry.target].number


def single(backend: str) -> bool:
    """Return whether a back end computes in numbers of single precision."""
    return precision(backend) == "float"
