"""Targets: programs become source text."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import NamedTuple

from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Function, Sources
from strapgen.support import checks
from strapgen.support.exceptions import InputError

__all__ = ["FIXED", "TARGETS", "Function", "Sources", "Target", "emit"]


class Target(NamedTuple):
    """A target: what it is, and the module of this package whose ``emit(program, target)`` prints it."""

    title: str
    module: str


#: Targets by name.
TARGETS = {
    "numpy": Target("numpy, vectorised over leading axes", "numpy_code"),
    "c": Target("C99 in double", "c"),
    "c-float": Target("C99 in float", "c"),
    "c-fixed": Target("C99 in fixed point: integers alone, error bounds certified", "c_fixed"),
    "fixed-model": Target("Python on integers, bit for bit what the fixed-point C computes", "integer_model"),
}

#: Targets that are made for settings: word, ranges, rounding.
FIXED = ("c-fixed", "fixed-model")


def emit(program: Program | FixedProgram, target: str, settings: Settings | None = None) -> Sources:
    """Generate source text for a program.

    Parameters
    ----------
    program : Program or FixedProgram
    target : str
        A key of `TARGETS`.
    settings : Settings, optional
        What fixed point is made for; it goes with the targets of `FIXED` alone.

    Returns
    -------
    Sources

    Raises
    ------
    InputError
        If the target is unknown or takes no settings, or the program cannot be lowered to integers.
    """
    module = import_module(f"{__name__}.{TARGETS[checks.choice('target', target, TARGETS)].module}.emit")
    if target in FIXED:
        fixed: Sources = module.emit(program, target, settings)
        lowered = program.program if isinstance(program, FixedProgram) else program
        return replace(fixed, own=lowered.own)
    if isinstance(program, FixedProgram):
        raise InputError(f"target {target} does not take fixed-point programs; these do: {', '.join(FIXED)}")
    if settings is not None:
        raise InputError(f"target {target} takes no fixed-point settings; these do: {', '.join(FIXED)}")
    sources: Sources = module.emit(program, target)
    return replace(sources, own=program.own)
