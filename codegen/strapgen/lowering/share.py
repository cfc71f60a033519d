"""Common subexpressions of a kernel are named across all its stages and outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import sympy as sp

from strapgen.kernel.kernel import Kernel
from strapgen.lowering.names import SHARED


@dataclass(frozen=True)
class _Definition:
    """One line of a computation: ``symbol = expression``."""

    symbol: sp.Symbol
    expression: sp.Expr
    meaning: str = ""


def share(kernel: Kernel, common: bool = True) -> tuple[list[_Definition], dict[sp.Symbol, sp.Expr]]:
    """Name the common subexpressions of a kernel, unless its formulas shall stay as they are.

    Returns the definitions of stages, outputs and common subexpressions, each before its first use, and the elements
    that need none: they are numbers, or other symbols, inside the kernel possibly negated.

    Elements are visited in the order of their names, so that two kernels that differ only in the order in
    which they store a state get the same arithmetic.
    """
    values: dict[sp.Symbol, sp.Expr] = {}
    definitions: list[_Definition] = []
    for stage in (*kernel.stages, *kernel.outputs):
        meaning = stage.signal.meaning
        result = stage in kernel.outputs or stage.signal.name == kernel.transition
        for name, expression in sorted(zip(stage.signal.elements, stage.expressions, strict=True)):
            symbol, expression = sp.Symbol(name, real=True), expression.xreplace(values)
            if expression.is_Symbol or expression.is_Rational or (not result and (-expression).is_Symbol):
                values[symbol] = expression
            else:
                definitions.append(_Definition(symbol, expression, meaning))
                meaning = ""
    if not common:
        return definitions, values
    elements = (name for signal in kernel.signals for name in signal.elements)
    excluded = [sp.Symbol(name, real=True) for name in elements]
    names = sp.numbered_symbols(SHARED, start=1, exclude=excluded, real=True)
    common_parts, reduced = sp.cse([d.expression for d in definitions], symbols=names, order="canonical")
    # A program cannot assign a condition to a name, so each condition goes back to where it is used.
    conditions = {symbol: expression for symbol, expression in common_parts if expression.is_Relational}
    pending = {s: e.xreplace(conditions) for s, e in common_parts if s not in conditions}
    reduced = [expression.xreplace(conditions) for expression in reduced]
    ordered: list[_Definition] = []

    def needed(expression: sp.Expr) -> Iterator[_Definition]:
        for symbol in sorted(
            expression.free_symbols & pending.keys(), key=lambda s: int(s.name[len(SHARED) :])
        ):
            if symbol in pending:
                definition = pending.pop(symbol)
                yield from needed(definition)
                yield _Definition(symbol, definition)

    for definition, expression in zip(definitions, reduced, strict=True):
        ordered.extend(needed(expression))
        ordered.append(_Definition(definition.symbol, expression, definition.meaning))
    return ordered, values
