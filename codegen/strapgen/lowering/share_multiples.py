"""The pass `share_multiples` takes a multiple that is computed anyway as a factor of a product.

Where k x is needed, x (a y + b z + c) is also (k x) (a/k y + b/k z + c/k). That pays where the other coefficients need
fewer multiplications: 1 needs none, and 2 needs a sum. Since k x is rounded and x is not, they have to be binary
numbers, which are not rounded either.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from strapgen.ir.program import Assignment, Constant, Node, Operation, Program, Reference, walk
from strapgen.lowering.trees import (
    Term,
    is_temporary,
    operation_count,
    plain,
    rewritten,
    scaled,
    scaling,
    shared_names,
    signed_sum,
    terms_of,
)


@dataclass(frozen=True)
class _Rewriting:
    """A product x s and a multiple k x, with s/k and what that saves."""

    product: Operation
    multiple: Operation
    total: Node
    saved: tuple[int, int]  # operations, and multiplications among them


def share_multiples(program: Program) -> Program:
    """Take multiples as factors of products, the one that saves most first, until none saves anything."""
    while best := max(_rewritings(program), key=lambda rewriting: rewriting.saved, default=None):
        program = _applied(program, best)
    return program


def _rewritings(program: Program) -> Iterator[_Rewriting]:
    """Yield the rewritings of a program that save something."""
    nodes = dict.fromkeys(node for a in program.body for node in walk(a.value))
    products = [node for node in nodes if isinstance(node, Operation) and node.kind == "multiply"]
    multiples = defaultdict[Node, list[Operation]](list)
    for product in products:
        if isinstance(product.arguments[0], Constant):
            multiples[product.arguments[1]].append(product)
    for product in products:
        for factor, total in (product.arguments, product.arguments[::-1]):
            if isinstance(factor, Reference) and factor in multiples and _is_sum(total):
                inside = set(walk(total))
                for multiple in multiples[factor]:
                    other = _divided(total, multiple)
                    before, after = _cost(total), _cost(other)
                    if after < before and _is_binary(other) and multiple not in inside:
                        saved = before[0] - after[0], before[1] - after[1]
                        yield _Rewriting(product, multiple, other, saved)


def _is_sum(node: Node) -> bool:
    return isinstance(node, Operation) and node.kind in ("add", "subtract")


def _cost(node: Node) -> tuple[int, int]:
    """Return the operations of a tree, and the multiplications among them."""
    products = sum(isinstance(part, Operation) and part.kind == "multiply" for part in walk(node))
    return operation_count(node), products


def _is_binary(node: Node) -> bool:
    """Return whether all numbers in a tree have finite binary expansions."""
    bottoms = [part.value.denominator for part in walk(node) if isinstance(part, Constant)]
    return all(bottom & (bottom - 1) == 0 for bottom in bottoms)


def _divided(total: Node, multiple: Operation) -> Node:
    """Return a sum divided by the coefficient of a multiple, term by term."""
    divisor, _ = scaling(multiple)
    terms: list[Term] = []
    for positive, term in terms_of(total):
        coefficient, rest = scaling(term)
        coefficient = (coefficient if positive else -coefficient) / divisor
        if rest is None:
            terms.append((coefficient > 0, Constant(abs(coefficient))))
        elif abs(coefficient) == 2 and isinstance(rest, Reference):
            terms.append((coefficient > 0, Operation("add", (rest, rest))))
        else:
            terms.append(scaled(coefficient, rest))
    return plain(signed_sum(terms))


def _applied(program: Program, rewriting: _Rewriting) -> Program:
    """Return a program after a rewriting, where the multiple has a name from the first use on."""
    name = Reference(_name_of(rewriting.multiple, program))
    body: list[Assignment] = []
    new: dict[Node, Node] = {}
    for assignment in program.body:
        if not new and {rewriting.product, rewriting.multiple}.intersection(walk(assignment.value)):
            if assignment.value == rewriting.multiple:
                name = Reference(assignment.name)
            else:
                body.append(Assignment(name.name, rewriting.multiple))
            product = Operation("multiply", (name, rewriting.total))
            new = {rewriting.product: product, rewriting.multiple: name}
        value = assignment.value if assignment.name == name.name else _replaced(assignment.value, new)
        body.append(replace(assignment, value=value))
    return replace(program, body=tuple(body))


def _name_of(multiple: Operation, program: Program) -> str:
    """Return a name for a multiple: x_over_3, x_times_2 or x_times_2_over_3, or that of a temporary of one."""
    (coefficient, rest), taken = scaling(multiple), {assignment.name for assignment in program.body}
    assert isinstance(rest, Reference)
    top, bottom = abs(coefficient.numerator), coefficient.denominator
    name = rest.name + (f"_times_{top}" if top != 1 else "") + (f"_over_{bottom}" if bottom != 1 else "")
    fits = coefficient > 0 and not is_temporary(rest.name) and name not in taken
    return name if fits else next(shared_names(program))


def _replaced(value: Node, new: Mapping[Node, Node]) -> Node:
    return rewritten(value, lambda node: new.get(node, node)) if new else value
