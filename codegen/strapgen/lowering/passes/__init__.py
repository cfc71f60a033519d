"""Passes are pure functions from program to program that leave every result unchanged and save operations."""

from __future__ import annotations

from collections.abc import Callable

from strapgen.ir.program import Program
from strapgen.lowering.passes.absorb_negations import absorb_negations
from strapgen.lowering.passes.drop_copies import drop_copies
from strapgen.lowering.passes.fold_constants import fold_constants
from strapgen.lowering.passes.horner_schemes import horner_schemes
from strapgen.lowering.passes.remove_unused import remove_unused
from strapgen.lowering.passes.reuse_values import reuse_values
from strapgen.lowering.passes.share_pairs import share_pairs

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

#: The extra cost of a division, a root or a function, in sums.
_LONG = 9


def optimize(program: Program) -> Program:
    """Run all passes repeatedly, as long as that saves operations; one that would add operations is undone."""
    while True:
        before = program
        for run in PASSES:
            changed = run(program)
            if cost(changed) <= cost(program):
                program = changed
        if cost(program) >= cost(before):
            return program


def cost(program: Program) -> tuple[int, int]:
    """Return the cost of a program: first its weighted number of operations, then its number of multiplications.

    A division, root or function has a higher weight, since it takes a processor as long as several sums.
    """
    operations = program.operations
    long = sum(operations[kind] for kind in ("divide", "sqrt", "function"))
    return sum(operations.values()) + _LONG * long, operations["multiply"]
