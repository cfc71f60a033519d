"""Sums as balanced trees: their shape, and that nothing else changes."""

from __future__ import annotations

from fractions import Fraction

import pytest
from derived import program

from strapgen.catalogue import Choice
from strapgen.fixedpoint.floating.bounds import rounding_bounds
from strapgen.ir.program import Node, Operation, walk
from strapgen.lowering.tree_sums import with_tree_sums


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = a + b + c + d", "y = a + b + (c + d)"),
        ("y = a - b - c - d", "y = a - b - (c + d)"),
        ("y = -(a + b) - c - d", "y = -(a + b) - c - d"),  # three terms, as the negative of a sum is one
        ("y = a - b + c - d", "y = a - b + (c - d)"),
        ("y = a + b + c + d + e", "y = a + b + c + (d + e)"),
        ("y = a + b + c - d - e + f + g - h", "y = a + b + (c - d) + (f - e + (g - h))"),
        # A sum inside another is part of it; one inside a product is a tree of its own.
        ("y = a + (b + (c - (d + e)))", "y = a + b + c - (d + e)"),
        ("y = a + b + (a + b + c + d) * e", "y = a + b + (a + b + (c + d)) * e"),
        ("y = sqrt(a + b + c + 1)", "y = sqrt(a + b + (c + 1))"),
        # Of three terms no tree is less deep.
        ("y = a + b - c", "y = a + b - c"),
        ("y = a - (b + c)", "y = a - (b + c)"),
    ],
)
def test_a_sum_is_written_as_a_tree(before, after, parse, show):
    assert show(with_tree_sums(parse(before))) == after


def depth(node: Node) -> int:
    """Return the largest number of sums that follow each other."""
    if not isinstance(node, Operation):
        return 0
    return max(map(depth, node.arguments)) + (node.kind in ("add", "subtract"))


@pytest.mark.parametrize("choice", [Choice("euler", "rk4", 2), Choice("dcm", "rk3", 2)])
def test_a_tree_is_less_deep_and_has_the_values_and_operations_of_the_chain(choice):
    chain = program(choice)
    tree = with_tree_sums(chain)
    assert tree.operations == chain.operations
    assert sum(depth(a.value) for a in tree.body) < sum(depth(a.value) for a in chain.body)
    elements = [name for signal in chain.inputs for name in signal.elements]
    values = {name: Fraction(k * k - 7, k + 3) for k, name in enumerate(elements)}
    assert tree.run(values) == chain.run(values)
    assert {n.kind for a in tree.body for n in walk(a.value) if isinstance(n, Operation)} <= {
        *("add", "subtract", "multiply", "negate")
    }


def test_the_bound_is_that_of_the_tree():
    chain = program(Choice("euler", "rk4", 2))
    bounds = [max(rounding_bounds(one).errors["next"]) for one in (chain, with_tree_sums(chain))]
    assert bounds[1] < bounds[0] * Fraction(9, 10)
