"""Targets: programs become source text."""

from __future__ import annotations

from strapgen import checks
from strapgen.program import Program
from strapgen.targets.sources import Function, Sources

__all__ = ["TARGETS", "Function", "Sources", "emit"]

#: Targets by name.
TARGETS = {
    "numpy": "numpy, vectorised over leading axes",
    "c": "C99 in double",
    "c-float": "C99 in float",
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
    checks.choice("target", target, TARGETS)
    if target == "numpy":
        from strapgen.targets import numpy

        return numpy.emit(program)
    from strapgen.targets import c

    return c.emit(program, c.DOUBLE if target == "c" else c.FLOAT)
