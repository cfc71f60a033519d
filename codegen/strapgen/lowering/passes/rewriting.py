"""Functions that rewrite the trees of a program from the leaves upwards, for use in several passes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from operator import is_not

from strapgen.ir.program import Node, Operation, Program, references

#: Outcomes of a pass for single values that are remembered: the candidates of a kernel have most values in common, and
#: passes run again until nothing changes.
REMEMBERED = 10_000


def rewritten(node: Node, rule: Callable[[Node], Node]) -> Node:
    """Return a node after a rule has been applied to all nodes in it, to arguments before their operation."""
    if isinstance(node, Operation):
        arguments = tuple([rewritten(argument, rule) for argument in node.arguments])
        if any(map(is_not, arguments, node.arguments)):
            node = Operation(node.kind, arguments)
    return rule(node)


def with_values(program: Program, change: Callable[[Node], Node]) -> Program:
    """Return a program with every assigned value changed."""
    return with_each(program, [change(assignment.value) for assignment in program.body])


def with_each(program: Program, values: list[Node]) -> Program:
    """Return a program with other values; the program itself if they are equal."""
    body = [
        assignment if value == assignment.value else replace(assignment, value=value)
        for assignment, value in zip(program.body, values, strict=True)
    ]
    if not any(map(is_not, body, program.body)):
        return program
    return replace(program, body=tuple(body))


def uses(program: Program) -> Counter[str]:
    """Count the uses of each name, in assignments and in results."""
    counts: Counter[str] = Counter()
    for assignment in program.body:
        counts.update(references(assignment.value))
    for result in program.results:
        for node in result.nodes:
            counts.update(references(node))
    return counts
