"""The pass `drop_copies` removes temporaries that are copies of other values."""

from __future__ import annotations

from dataclasses import replace

from strapgen.ir.program import Constant, Node, Program, Reference, Result
from strapgen.lowering.names import is_temporary
from strapgen.lowering.passes.rewriting import rewritten


def drop_copies(program: Program) -> Program:
    """Replace each temporary that is a copy of a name or of a number by the original."""
    copies: dict[str, Node] = {}

    def rule(node: Node) -> Node:
        return copies.get(node.name, node) if isinstance(node, Reference) else node

    body = []
    for assignment in program.body:
        value = rewritten(assignment.value, rule)
        if isinstance(value, Reference | Constant) and is_temporary(assignment.name):
            copies[assignment.name] = value
        else:
            body.append(replace(assignment, value=value))
    if not copies:
        return program

    def renamed(result: Result) -> Result:
        return replace(result, nodes=tuple(map(rule, result.nodes)))

    transition = None if program.transition is None else renamed(program.transition)
    return replace(
        program, body=tuple(body), outputs=tuple(map(renamed, program.outputs)), transition=transition
    )
