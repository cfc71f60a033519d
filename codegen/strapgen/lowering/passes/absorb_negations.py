"""The pass `absorb_negations` turns negations into subtractions."""

from __future__ import annotations

from functools import lru_cache

from strapgen.ir.program import Constant, Node, Operation, Program, Reference, names_in
from strapgen.lowering.names import is_temporary
from strapgen.lowering.passes.rewriting import REMEMBERED, rewritten, with_each

_EVEN = ("cos", "sinc")


def absorb_negations(program: Program) -> Program:
    """Move signs up the trees until a sum or a constant absorbs them; a temporary hands its sign to its users."""
    values = [_absorbed(assignment.value) for assignment in program.body]
    results = {
        node.name for result in program.results for node in result.nodes if isinstance(node, Reference)
    }
    for place, assignment in enumerate(program.body):
        inner = _inside(values[place])
        if inner is not None and is_temporary(assignment.name) and assignment.name not in results:
            values = [_with_negated(value, assignment.name) for value in values]
            values[place] = inner
    return with_each(program, [_with_signed_constant(value) for value in values])


@lru_cache(REMEMBERED)
def _absorbed(value: Node) -> Node:
    """Return a value with its signs moved up; the value itself if none moves."""
    outcome = rewritten(value, _rule)
    return value if outcome == value else outcome


def _with_negated(value: Node, name: str) -> Node:
    """Return a value with the negative of a name in its place, and the signs moved up."""
    if name not in names_in(value):
        return _absorbed(value)
    return rewritten(
        value, lambda node: Operation("negate", (node,)) if node == Reference(name) else _rule(node)
    )


def _inside(node: Node) -> Node | None:
    """Return the argument of a negation; None for other nodes."""
    return node.arguments[0] if isinstance(node, Operation) and node.kind == "negate" else None


def _with_signed_constant(value: Node) -> Node:
    """Put a sign that no sum has absorbed into a constant factor, if there is one."""
    inner = _inside(value)
    return (_by_constant(inner) or value) if inner is not None else value


def _by_constant(node: Node) -> Node | None:
    """Return the negative of a node with the sign in a constant factor; None if it has none."""
    if not isinstance(node, Operation):
        return None
    left, *rest = node.arguments
    if node.kind == "multiply" and isinstance(left, Constant):
        return Operation("multiply", (Constant(-left.value), *rest))
    if node.kind == "add":
        for one, other in (node.arguments, node.arguments[::-1]):
            negative = _by_constant(one)
            if negative is not None:
                return Operation("subtract", (negative, other))
    return None


def _negated(node: Node) -> Node:
    if isinstance(node, Constant):
        return Constant(-node.value)
    if isinstance(node, Operation):
        if node.kind == "negate":
            return node.arguments[0]
        if node.kind == "subtract":
            return Operation("subtract", node.arguments[::-1])
        if node.kind == "multiply":
            for k, argument in enumerate(node.arguments):
                if isinstance(argument, Operation) and argument.kind in ("subtract", "negate"):
                    arguments = list(node.arguments)
                    arguments[k] = _negated(argument)
                    return Operation("multiply", tuple(arguments))
    return Operation("negate", (node,))


def _rule(node: Node) -> Node:
    if not isinstance(node, Operation):
        return node
    inner = [_inside(argument) for argument in node.arguments]
    if node.kind == "negate":
        return _negated(node.arguments[0])
    if not any(inner):
        return node
    if node.kind in ("add", "subtract"):
        (left, right), (minus_left, minus_right) = node.arguments, inner
        plus = node.kind == "add"
        if minus_right is not None:
            plus, right = not plus, minus_right
        if minus_left is None:
            return Operation("add" if plus else "subtract", (left, right))
        if plus:
            return Operation("subtract", (right, minus_left))
        return Operation("negate", (Operation("add", (minus_left, right)),))
    if node.kind in ("multiply", "divide"):
        arguments = tuple(i if i is not None else a for i, a in zip(inner, node.arguments, strict=True))
        result = Operation(node.kind, arguments)
        return result if all(inner) else _negated(result)
    if node.kind == "sin" and inner[0] is not None:
        return Operation("negate", (Operation("sin", (inner[0],)),))
    if node.kind in _EVEN and inner[0] is not None:
        return Operation(node.kind, (inner[0],))
    return node
