"""Targets print programs as source text."""

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

__all__ = ["FIXED", "TARGETS", "Function", "Sources", "Target", "emit", "require"]


class Target(NamedTuple):
    """A target: its title, the folder here whose ``emit(program, target)`` prints it, and the program that it takes.

    `words` are the lengths of word that it supports, in bits; None stands for any.
    """

    title: str
    module: str
    program: type[Program | FixedProgram] = Program
    words: tuple[int, ...] | None = None


#: Targets by name.
TARGETS = {
    "numpy": Target("numpy, vectorised over leading axes", "numpy_code"),
    "c": Target("C99 in double", "c"),
    "c-float": Target("C99 in float", "c"),
    "c-fixed": Target(
        "C99 in fixed point: integers alone, error bounds certified", "c_fixed", FixedProgram, (16, 32, 64)
    ),
    "fixed-model": Target(
        "Python on integers, bit for bit what the fixed-point C computes", "integer_model", FixedProgram
    ),
}

#: Targets of fixed point, which take a quantized program: its settings are word, ranges, rounding.
FIXED = tuple(name for name, target in TARGETS.items() if target.program is FixedProgram)


def require(target: str, settings: Settings | None = None) -> None:
    """Check that a target exists, and that settings of fixed point go with it.

    Raises
    ------
    InputError
        If the target is unknown, takes no settings, or does not have their word.
    """
    checks.choice("target", target, TARGETS)
    if target in FIXED:
        _require_word(target, (settings or Settings()).word)
    elif settings is not None:
        raise InputError(f"target {target} takes no fixed-point settings; these do: {', '.join(FIXED)}")


def emit(program: Program | FixedProgram, target: str) -> Sources:
    """Print a program as source text.

    Parameters
    ----------
    program : Program or FixedProgram
        A `FixedProgram` for the targets of `FIXED`, a `Program` for all others.
    target : str
        A key of `TARGETS`.

    Returns
    -------
    Sources

    Raises
    ------
    InputError
        If the target is unknown, takes the other kind of program, or does not have its word.
    """
    entry = TARGETS[checks.choice("target", target, TARGETS)]
    if not isinstance(program, entry.program):
        if target in FIXED:
            raise InputError(f"target {target} takes quantized programs alone; strapgen.quantize makes them")
        raise InputError(f"target {target} does not take fixed-point programs; these do: {', '.join(FIXED)}")
    if isinstance(program, FixedProgram):
        _require_word(target, program.word)
    sources: Sources = import_module(f"{__name__}.{entry.module}.emit").emit(program, target)
    plain = program.program if isinstance(program, FixedProgram) else program
    return replace(sources, own=plain.own)


def _require_word(target: str, word: int) -> None:
    words = TARGETS[target].words
    if words is not None and word not in words:
        allowed = ", ".join(map(str, words))
        raise InputError(f"word is {word}; in C it is {allowed} bits; the integer model takes any")
