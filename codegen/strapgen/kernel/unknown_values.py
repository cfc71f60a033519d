"""Values for unknown coefficients."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.suggestions import unknown
from strapgen.kernel import reading
from strapgen.kernel.evaluation import exact


def read(what: str, unknowns: tuple[str, ...], values: Mapping[str, Any]) -> dict[sp.Symbol, sp.Expr]:
    """Return the values of unknowns as exact expressions; `what` holds them, in an error message.

    >>> read("this", ("a", "b"), {"a": "1 - b"})
    {a: 1 - b}
    """
    symbols = {name: sp.Symbol(name, real=True) for name in unknowns}
    chosen: dict[sp.Symbol, sp.Expr] = {}
    for name, value in values.items():
        if name not in symbols:
            raise InputError(f"{what}: {unknown('unknown', name, unknowns)}")
        number: Any = value
        if isinstance(value, str):
            number = reading.expression(f"{what}: {name}", value, symbols, {"sqrt": sp.sqrt})
        elif isinstance(value, (Fraction, int)) and not isinstance(value, bool):
            number = exact(Fraction(value))
        elif isinstance(value, sp.Expr):
            number = value.xreplace({s: symbols[s.name] for s in value.free_symbols if s.name in symbols})
        if not isinstance(number, sp.Expr) or number.has(sp.Float) or isinstance(value, float):
            raise InputError(f"{what}: {name} is {value!r}; an exact number such as 57/80 is needed")
        if others := sorted(s.name for s in number.free_symbols if s not in symbols.values()):
            raise InputError(f"{what}: {name} is {value}, which holds {', '.join(others)}")
        chosen[symbols[name]] = number
    return chosen


def remaining(unknowns: tuple[str, ...], chosen: Mapping[sp.Symbol, sp.Expr]) -> tuple[str, ...]:
    """Return the unknowns left after a substitution: those without a value, and those in a value."""
    replaced = {symbol.name for symbol in chosen}
    held = {symbol.name for value in chosen.values() for symbol in value.free_symbols}
    return tuple(name for name in unknowns if name not in replaced or name in held)
