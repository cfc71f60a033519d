"""The pass `fold_constants` carries out operations on constants exactly, when code is generated.

A division by a constant becomes a multiplication by its reciprocal, which is rounded once, when a target prints it.
The constants of a product become one factor in front of it. If all uses of a temporary multiply it by constants, its
own constant factor moves into them.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

from strapgen.ir.program import OPERATIONS, Constant, Node, Operation, Program, Reference, names_in, walk
from strapgen.lowering.names import is_temporary
from strapgen.lowering.passes.rewriting import REMEMBERED, rewritten, uses, with_values

_EXACT = ("add", "subtract", "multiply", "divide", "negate")


def fold_constants(program: Program) -> Program:
    """Replace operations on constants by their exact values."""
    return with_values(_scalings_moved(with_values(program, _folded)), _folded)


@lru_cache(REMEMBERED)
def _folded(node: Node) -> Node:
    return rewritten(node, _rule)


def _rule(node: Node) -> Node:
    if not isinstance(node, Operation) or node.kind not in _EXACT:
        return node
    numbers = [argument.value for argument in node.arguments if isinstance(argument, Constant)]
    if len(numbers) == len(node.arguments) and not (node.kind == "divide" and not numbers[1]):
        return Constant(OPERATIONS[node.kind](*numbers))
    if node.kind in ("multiply", "divide"):
        return _product(node)
    if node.kind in ("add", "subtract") and numbers and not numbers[0]:
        left, right = node.arguments
        if isinstance(right, Constant):
            return left
        return right if node.kind == "add" else Operation("negate", (right,))
    return node


def _product(node: Operation) -> Node:
    (a, first), (b, second) = map(scaling, node.arguments)
    if node.kind == "divide" and b == 0:
        return node
    coefficient = a * b if node.kind == "multiply" else a / b
    if not coefficient:
        return Constant(Fraction(0))
    rest: Node | None
    if node.kind == "multiply":
        rest = (
            second if first is None else first if second is None else Operation("multiply", (first, second))
        )
    elif second is None:
        rest = first
    else:
        # A reciprocal keeps its numerator: 2/x is one operation.
        top: Node = first or Constant(abs(coefficient))
        rest = Operation("divide", (top, second))
        if first is None:
            coefficient /= abs(coefficient)
    if rest is None:
        return Constant(coefficient)
    if abs(coefficient) != 1:
        rest = Operation("multiply", (Constant(abs(coefficient)), rest))
    return rest if coefficient > 0 else Operation("negate", (rest,))


def scaling(node: Node) -> tuple[Fraction, Node | None]:
    """Return a node as a number times another node; None stands for the latter if the node is a number."""
    if isinstance(node, Constant):
        return node.value, None
    if isinstance(node, Operation):
        if node.kind == "negate":
            coefficient, rest = scaling(node.arguments[0])
            return -coefficient, rest
        if node.kind == "multiply" and isinstance(node.arguments[0], Constant):
            return node.arguments[0].value, node.arguments[1]
    return Fraction(1), node


def _scalings_moved(program: Program) -> Program:
    """Move the constant factor of a temporary into its uses if all of these multiply it by constants."""
    scaled = {}
    for assignment in program.body:
        coefficient, rest = scaling(assignment.value)
        if rest is not None and coefficient != 1 and is_temporary(assignment.name):
            scaled[assignment.name] = coefficient, rest
    if not scaled:
        return program
    again: dict[str, int] = defaultdict(int)
    for assignment in program.body:
        for node in walk(assignment.value):
            if isinstance(node, Operation) and node.kind == "multiply":
                coefficient, rest = scaling(node)
                if abs(coefficient) != 1 and isinstance(rest, Reference):
                    again[rest.name] += 1
    counts = uses(program)
    moved = {name: value for name, value in scaled.items() if counts[name] == again[name]}
    if not moved:
        return program

    def rule(node: Node) -> Node:
        if isinstance(node, Reference) and node.name in moved:
            return Operation("multiply", (Constant(moved[node.name][0]), node))
        return node

    body = tuple(replace(a, value=moved[a.name][1] if a.name in moved else a.value) for a in program.body)
    body = tuple(
        replace(a, value=rewritten(a.value, rule)) if moved.keys() & names_in(a.value) else a for a in body
    )
    return replace(program, body=body)
