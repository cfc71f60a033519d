"""The passes: pure functions from program to program that keep every value and save operations."""

from __future__ import annotations

from collections.abc import Callable

from strapgen.lowering.passes.absorb_negations import absorb_negations
from strapgen.lowering.passes.drop_copies import drop_copies
from strapgen.lowering.passes.fold_constants import fold_constants
from strapgen.lowering.passes.horner_schemes import horner_schemes
from strapgen.lowering.passes.remove_unused import remove_unused
from strapgen.lowering.passes.reuse_values import reuse_values
from strapgen.lowering.passes.share_pairs import share_pairs
from strapgen.program import Program

Pass = Callable[[Program], Program]

#: The passes in the order in which they run.
PASSES: tuple[Pass, ...] = (
    fold_constants,
    absorb_negations,
    drop_copies,
    horner_schemes,
    reuse_values,
    share_pairs,
    remove_unused,
)


#: What a division, a root or a function costs beyond a sum.
_LONG = 9


def optimize(program: Program) -> Program:
    """Run all passes, again and again while that saves operations; a pass that would cost some is left out."""
    while True:
        before = program
        for run in PASSES:
            changed = run(program)
            if cost(changed) <= cost(program):
                program = changed
        if cost(program) >= cost(before):
            return program


def cost(program: Program) -> tuple[int, int]:
    """Return what is to be small: all operations, and of these the multiplications.

    A division, root or function takes a processor as long as several sums and products.
    """
    operations = program.operations
    long = sum(operations[kind] for kind in ("divide", "sqrt", "function"))
    return sum(operations.values()) + _LONG * long, operations["multiply"]
