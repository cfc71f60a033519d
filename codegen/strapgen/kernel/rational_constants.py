"""Rounds irrational constants to rational ones, once, with so many digits that no target can tell the difference."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from strapgen.kernel.kernel import Kernel, Stage

#: Decimal digits of a rounded constant: twice those of the arithmetic that programs are compared with.
DIGITS = 80


def rationalized(kernel: Kernel) -> Kernel:
    """Return a kernel whose constants are rational: the kernel itself if they all are.

    Parameters
    ----------
    kernel : Kernel

    Returns
    -------
    Kernel
        With a note on the rounding if there was any.

    Examples
    --------
    >>> from strapgen.kernel.kernel import KernelBuilder
    >>> from strapgen.ir.signals import Signal
    >>> build = KernelBuilder()
    >>> x = build.scalar(Signal.scalar("x"))
    >>> _ = build.output(Signal.scalar("y"), [sp.sqrt(2) * x + 1])
    >>> rounded = rationalized(build.kernel("root", "Root", "none"))
    >>> rounded.outputs[0].expressions[0].subs(x, 1).is_Rational
    True
    """
    stages, outputs = (tuple(map(_rounded_stage, group)) for group in (kernel.stages, kernel.outputs))
    if stages == kernel.stages and outputs == kernel.outputs:
        return kernel
    note = f"Irrational constants are rounded to {DIGITS} digits, and once more to the format of the target."
    return replace(kernel, stages=stages, outputs=outputs, notes=(*kernel.notes, note))


def _rounded_stage(stage: Stage) -> Stage:
    return replace(stage, expressions=tuple(map(_rounded, stage.expressions)))


def _rounded(expression: sp.Expr) -> sp.Expr:
    """Return an expression with its irrational numbers rounded."""
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
