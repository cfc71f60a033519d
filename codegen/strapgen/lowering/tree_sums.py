"""Writes sums of a program as balanced trees, in place of one term after the other.

A tree of n terms is as deep as the logarithm of n: a processor adds its parts at once, and fewer roundings follow each
other. No program is rewritten so unless its user asks for it, since other bits come out.
"""

from __future__ import annotations

from dataclasses import replace

from strapgen.ir.program import Node, Operation, Program
from strapgen.lowering.trees import Term, plain, signed_sum, terms_of, with_values

_NOTE = "Sums of four terms or more are balanced trees."
#: Terms of a sum from which on a tree is less deep than a chain.
_LEAST = 4


def with_tree_sums(program: Program) -> Program:
    """Return a program whose sums of four terms or more are balanced trees; in exact numbers it computes the same."""
    info = replace(program.info, arguments=f"{program.arguments} --sums tree", notes=(*program.notes, _NOTE))
    return replace(with_values(program, _balanced), info=info)


def _balanced(node: Node) -> Node:
    if not isinstance(node, Operation):
        return node
    if node.kind not in ("add", "subtract"):
        return Operation(node.kind, tuple(map(_balanced, node.arguments)))
    terms = [(positive, _balanced(term)) for positive, term in terms_of(node)]
    if len(terms) >= _LEAST:
        return plain(_tree(terms))
    left, right = node.arguments
    return Operation(node.kind, (_balanced(left), _balanced(right)))


def _tree(terms: list[Term]) -> Term:
    """Return the sum of the sums of both halves, each a tree."""
    if len(terms) == 1:
        return terms[0]
    middle = (len(terms) + 1) // 2
    return signed_sum([_tree(terms[:middle]), _tree(terms[middle:])])
