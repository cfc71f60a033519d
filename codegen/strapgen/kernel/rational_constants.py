"""Irrational constants as rational ones, rounded once to so many digits that no target can tell the difference."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from strapgen.kernel.kernel import Kernel, Stage

#: Decimal digits of a rounded constant: twice those of the arithmetic that programs are compared with.
DIGITS = 80


def rationalized(kernel: Kernel) -> Kernel:
    """Return a kernel with its irrational constants rounded and a note that says so; itself if it has none."""
    stages, outputs = (tuple(map(_rounded_stage, group)) for group in (kernel.stages, kernel.outputs))
    if stages == kernel.stages and outputs == kernel.outputs:
        return kernel
    note = f"Irrational constants are rounded to {DIGITS} digits, and once more to the format of the target."
    return replace(kernel, stages=stages, outputs=outputs, notes=(*kernel.notes, note))


def _rounded_stage(stage: Stage) -> Stage:
    return replace(stage, expressions=tuple(map(_rounded, stage.expressions)))


def _rounded(expression: sp.Expr) -> sp.Expr:
    numbers = expression.atoms(sp.Pow, sp.NumberSymbol, sp.Function)
    if not any(part.is_number and not part.is_Rational for part in numbers):
        return expression  # rebuilding it could make SymPy multiply it out
    if expression.is_number:
        return sp.Rational(sp.N(expression, DIGITS))
    if expression.is_Mul:  # all its numbers together are one constant
        numbers, rest = expression.as_independent(*expression.free_symbols, as_Add=False)
        if numbers != 1:
            return sp.Mul(_rounded(numbers), _rounded(rest))
    return expression.func(*map(_rounded, expression.args))
