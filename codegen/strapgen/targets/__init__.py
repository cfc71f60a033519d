"""Targets: programs become source text."""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple

from strapgen import checks
from strapgen.program import Program
from strapgen.targets.sources import Function, Sources

__all__ = ["TARGETS", "Function", "Sources", "Target", "emit"]


class Target(NamedTuple):
    """A target: what it is, and the module of this package whose ``emit(program, target)`` prints it."""

    title: str
    module: str


#: Targets by name.
TARGETS = {
    "numpy": Target("numpy, vectorised over leading axes", "numpy"),
    "c": Target("C99 in double", "c"),
    "c-float": Target("C99 in float", "c"),
}


def emit(program: Program, target: str) -> Sources:
    """Generate source text for a program.

    Parameters
    ----------
    program : Program
    target : str
        A key of `TARGETS`.

    Returns
    -------
    Sources

    Raises
    ------
    InputError
        If the target is unknown.
    """
    module = import_module(f"{__name__}.{TARGETS[checks.choice('target', target, TARGETS)].module}")
    sources: Sources = module.emit(program, target)
    return sources
