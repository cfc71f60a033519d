"""Targets print programs as source text."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Function, Sources
from strapgen.targets import registry
from strapgen.targets.registry import BUILT_IN, TARGETS, Target, titles

if TYPE_CHECKING:
    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.program import Program

__all__ = [
    "BUILT_IN",
    "TARGETS",
    "Function",
    "Sources",
    "Target",
    "emit",
    "fixed_targets",
    "require",
    "system_targets",
    "titles",
]


def fixed_targets() -> tuple[str, ...]:
    """Return the names of strapgen's targets of fixed point, which take a quantized program, and settings."""
    return tuple(name for name, target in BUILT_IN.items() if target.fixed)


def system_targets() -> tuple[str, ...]:
    """Return the names of strapgen's targets that print a described system as a whole: those in C and in Python."""
    return tuple(name for name, target in BUILT_IN.items() if target.language in ("C", "Python"))


def require(target: str, settings: Settings | None = None) -> None:
    """Refuse a target that is unknown or cannot be used, takes no fixed-point settings, or does not have their word."""
    entry = _entry(target)
    if entry.fixed:
        _require_word(entry, (settings or Settings()).word)
    elif settings is not None:
        takers = ", ".join(fixed_targets())
        raise InputError(f"target {target} takes no fixed-point settings; these do: {takers}")


def emit(program: Program | FixedProgram, target: str) -> Sources:
    """Print a program as source text: a `FixedProgram` for the targets of fixed point, a `Program` for all others."""
    entry = _entry(target)
    if not isinstance(program, entry.program):
        if entry.fixed:
            raise InputError(f"target {target} takes quantized programs alone; strapgen.quantize makes them")
        takers = ", ".join(fixed_targets())
        raise InputError(f"target {target} does not take fixed-point programs; these do: {takers}")
    from strapgen.ir.integer_program import FixedProgram

    if isinstance(program, FixedProgram):
        _require_word(entry, program.word)
    plain = program.program if isinstance(program, FixedProgram) else program
    return replace(registry.run(target, program), bundled_programs=plain.bundled_programs)


def _entry(name: str) -> Target:
    """Return a target by name; those of entry points are looked for where strapgen has none of the name."""
    return BUILT_IN[name] if name in BUILT_IN else TARGETS[checks.choice("target", name, TARGETS)]


def _require_word(entry: Target, word: int) -> None:
    if entry.words is not None and word not in entry.words:
        allowed = ", ".join(map(str, entry.words))
        raise InputError(f"word is {word}; in C it is {allowed} bits; the integer model takes any")
