"""Lowering: an exact kernel becomes straight-line code.

SymPy ends here. `share` finds common subexpressions while the algorithm is still symbolic, `gate` turns it
into a `Program`, and the passes that follow are pure functions from program to program.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from strapgen.kernel import Kernel
from strapgen.lowering.gate import gate
from strapgen.lowering.reuse import reuse_values
from strapgen.lowering.share import share
from strapgen.program import Program

Pass = Callable[[Program], Program]


def remove_unused(program: Program) -> Program:
    """Drop assignments that no result needs."""
    used = program.used()
    return replace(program, body=tuple(a for a in program.body if a.name in used))


#: Passes in the order in which they run.
PASSES: tuple[Pass, ...] = (reuse_values, remove_unused)


def lower(kernel: Kernel) -> Program:
    """Turn a kernel into straight-line code with common subexpressions computed once.

    Parameters
    ----------
    kernel : Kernel

    Returns
    -------
    Program

    Raises
    ------
    NotImplementedError
        If an expression holds a function that programs do not know.

    Examples
    --------
    >>> from strapgen import derive
    >>> lower(derive("euler", method="rk1", increments=1)).operations["multiply"]
    15
    """
    program = gate(kernel, share(kernel))
    for run in PASSES:
        program = run(program)
    return program
