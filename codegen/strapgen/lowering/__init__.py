"""Lowering: an exact kernel becomes straight-line code.

SymPy ends here. The transition of an attitude step is brought into `canonical` form, in several bases; everything
else goes through `share`, which finds common subexpressions while formulas are still symbolic, and `gate`, which
writes them as a `Program`. The passes that follow are pure functions from program to program. Of all the programs
for one kernel the one with the fewest operations is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from strapgen.kernel import Kernel
from strapgen.lowering import canonical
from strapgen.lowering.gate import gate
from strapgen.lowering.passes import PASSES, cost, optimize
from strapgen.lowering.share import share
from strapgen.program import Program, Reference, Result

__all__ = ["PASSES", "candidates", "lower"]


def lower(kernel: Kernel) -> Program:
    """Turn a kernel into straight-line code with the fewest operations that are known for it.

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
    >>> program = lower(derive("euler", method="rk4", increments=2))
    >>> program.operations["multiply"], program.operations["add"]
    (38, 30)
    """
    core = canonical.extract_core(kernel)
    program = min(map(optimize, candidates(kernel, core)), key=cost)
    if core is not None:
        canonical.verify(core, program)
    return program


def candidates(kernel: Kernel, core: canonical.Core | None) -> Iterator[Program]:
    """Yield programs for a kernel, before the passes: its formulas, with CSE and without, or canonical forms."""
    yield gate(kernel, share(kernel))
    if core is None:
        yield gate(kernel, share(kernel, common=False))
        return
    update = replace(kernel, inputs=(kernel.inputs[0], core.transition), stages=(), transition=None)
    after = gate(update, share(update))
    transition = Result(core.transition, tuple(map(Reference, core.transition.elements)))
    for body in canonical.forms(core):
        yield replace(after, inputs=kernel.inputs, body=(*body, *after.body), transition=transition)
