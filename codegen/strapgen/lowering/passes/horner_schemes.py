"""The pass `horner_schemes` writes polynomials with nested products."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

from strapgen.ir.program import Constant, Node, Operation, Program
from strapgen.kernel.polynomials import ONE, Polynomial, add, atom, multiply, scale
from strapgen.lowering.arithmetic import horner, operation_count, plain
from strapgen.lowering.passes.rewriting import REMEMBERED, with_values

#: Most terms of a polynomial that is rewritten: expanding a longer one takes long and saves no operations.
_MOST_TERMS = 60

_POLYNOMIAL = ("add", "subtract", "multiply", "negate")


def horner_schemes(program: Program) -> Program:
    """Write every polynomial by Horner's scheme where that takes fewer operations."""
    return with_values(program, _written)


@lru_cache(REMEMBERED)
def _written(node: Node) -> Node:
    if not isinstance(node, Operation):
        return node
    if node.kind in _POLYNOMIAL:
        atoms: dict[Node, int] = {}
        polynomial = _polynomial(node, atoms)
        if polynomial is not None:
            tree = plain(horner(polynomial, list(atoms).__getitem__))
            return tree if operation_count(tree) < operation_count(node) else node
    arguments = tuple(map(_written, node.arguments))
    return node if arguments == node.arguments else Operation(node.kind, arguments)


def _polynomial(node: Node, atoms: dict[Node, int]) -> Polynomial | None:
    """Return a node as a polynomial in those nodes that are no sums or products; None if it has too many terms."""
    if isinstance(node, Constant):
        return scale(ONE, node.value)
    if not isinstance(node, Operation) or node.kind not in _POLYNOMIAL:
        return atom(atoms.setdefault(_written(node), len(atoms)))
    parts = [_polynomial(argument, atoms) for argument in node.arguments]
    first = parts[0]
    second = parts[-1]
    if first is None or second is None:
        return None
    if node.kind == "negate":
        return scale(first, Fraction(-1))
    if node.kind != "multiply":
        return add(first, second, 1 if node.kind == "add" else -1)
    if len(first) * len(second) > _MOST_TERMS:
        return None
    return multiply(first, second)
