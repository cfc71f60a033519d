"""The pass `reuse_values` computes equal operations once.

`share` finds common subexpressions of formulas. After sums and products have been ordered and powers unrolled, a few
more operations are equal; this pass compares node by node and finds them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from operator import is_not

from strapgen.ir.program import Assignment, Node, Operation, Program, Reference
from strapgen.lowering.names import shared_names


def reuse_values(program: Program) -> Program:
    """Name every operation that occurs more than once and refer to it by its name."""
    occurrences = _occurrences(program)
    names = shared_names(program)
    known: dict[Node, Reference] = {}
    body: list[Assignment] = []

    def rewrite(node: Node, whole: bool = False) -> Node:
        if not isinstance(node, Operation):
            return node
        if node in known:
            return known[node]
        arguments = tuple([rewrite(argument) for argument in node.arguments])
        is_changed = any(map(is_not, arguments, node.arguments))
        rewritten = Operation(node.kind, arguments) if is_changed else node
        if whole or occurrences[node] < 2:
            return rewritten
        known[node] = Reference(next(names))
        body.append(Assignment(known[node].name, rewritten))
        return known[node]

    for assignment in program.body:
        value = rewrite(assignment.value, whole=True)
        body.append(assignment if value is assignment.value else replace(assignment, value=value))
        known.setdefault(assignment.value, Reference(assignment.name))
    return program if body == [*program.body] else replace(program, body=tuple(body))


def _occurrences(program: Program) -> Counter[Node]:
    """Count equal operations; the arguments of an operation that occurs again are not counted again."""
    seen: Counter[Node] = Counter()

    def visit(node: Node) -> None:
        if not isinstance(node, Operation):
            return
        if node.kind != "at_least":  # a condition cannot be assigned to a name
            seen[node] += 1
        if seen[node] < 2:
            for argument in node.arguments:
                visit(argument)

    for assignment in program.body:
        visit(assignment.value)
    return seen
