"""Directional derivatives of the stages of a kernel: the change of every quantity for given changes of its inputs.

This is the arithmetic of dual numbers a + b eps with eps^2 = 0: the part in eps of every stage.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

import sympy as sp

from strapgen.kernel.kernel import KernelBuilder, Stage


def add_tangents(
    build: KernelBuilder,
    stages: Iterable[Stage],
    changes: Mapping[sp.Symbol, sp.Expr],
    ending: str,
    unit: str,
) -> dict[sp.Symbol, sp.Expr]:
    """Add a stage for the change of every stage that changes, and return the changes of all symbols.

    `ending` ends the names of these stages; where a stage is an angle in rad, its change has the `unit`.

    >>> from strapgen.ir.signals import Signal
    >>> build = KernelBuilder()
    >>> x, dx = build.scalar(Signal.scalar("x")), build.scalar(Signal.scalar("dx"))
    >>> square = build.value("square", x**2)
    >>> add_tangents(build, build.stages[:], {x: dx}, "change", "m/s")[square]
    square_change
    >>> build.stages[-1].expressions
    (2*dx*x,)
    """
    known = dict(changes)
    for stage in list(stages):
        elements = [sp.Symbol(name, real=True) for name in stage.signal.elements]
        expressions = [
            tangent(element, expression, known)
            for element, expression in zip(elements, stage.expressions, strict=True)
        ]
        if not any(expressions):
            continue
        if all(expression.is_Symbol or expression == 0 for expression in expressions):
            known |= dict(zip(elements, expressions, strict=True))
            continue
        signal = replace(
            stage.signal,
            name=f"{stage.signal.name}_{ending}",
            elements=tuple(_named(name, ending) for name in stage.signal.elements),
            unit=unit if stage.signal.unit == "rad" else stage.signal.unit,
            meaning=f"change of: {stage.signal.meaning}",
            bound=None,
            constraint="",
        )
        known |= dict(zip(elements, build.stage(signal, expressions), strict=True))
    return known


def tangent(element: sp.Symbol, expression: sp.Expr, changes: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return the change of an element by its expression and the changes of the symbols in it."""
    if expression.is_Pow and expression.exp == -sp.S.Half:  # no new root: a power of the element
        return -(element**3) / 2 * tangent(element, expression.base, changes)
    terms = [
        _slope(expression, symbol) * changes[symbol]
        for symbol in sorted(expression.free_symbols, key=str)
        if changes.get(symbol, 0) != 0
    ]
    return sp.Add(*terms)


@lru_cache(10_000)
def _slope(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return a partial derivative, cached: the changes along all inputs of a kernel share it."""
    return sp.diff(expression, symbol)


def _named(element: str, ending: str) -> str:
    """Return the name of an element's change: the axis stays last."""
    name, separator, axis = element.rpartition("_")
    return f"{name}_{ending}_{axis}" if separator and len(axis) == 1 else f"{element}_{ending}"
