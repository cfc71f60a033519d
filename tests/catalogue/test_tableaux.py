"""Butcher tableaux: exact order conditions, from rooted trees."""

import math
from fractions import Fraction
from itertools import combinations_with_replacement

import pytest

from strapgen.catalogue import METHODS
from strapgen.catalogue.tableaux import TABLEAUX, Tableau

MOST_NODES = 5
TABLEAU = pytest.mark.parametrize("tableau", TABLEAUX.values(), ids=TABLEAUX)


def trees() -> dict[int, list[tuple]]:
    """Return the rooted trees by their number of nodes; a tree is the tuple of its root's subtrees."""
    found: dict[int, list[tuple]] = {1: [()]}
    for size in range(2, MOST_NODES + 1):
        smaller = [tree for s in range(1, size) for tree in found[s]]
        found[size] = [
            children
            for count in range(1, size)
            for children in combinations_with_replacement(smaller, count)
            if sum(map(nodes, children)) == size - 1
        ]
    return found


def nodes(tree: tuple) -> int:
    return 1 + sum(map(nodes, tree))


def density(tree: tuple) -> int:
    return nodes(tree) * math.prod(map(density, tree))


def stage_weights(tableau: Tableau, tree: tuple) -> list[Fraction]:
    """Return the product over the subtrees of (matrix times their weights), stage by stage."""
    product = [Fraction(1)] * len(tableau.nodes)
    for subtree in tree:
        inner = stage_weights(tableau, subtree)
        for i, row in enumerate(tableau.matrix):
            product[i] *= sum((a * w for a, w in zip(row, inner, strict=False)), Fraction(0))
    return product


def holds(tableau: Tableau, tree: tuple) -> bool:
    """Tell whether sum_i b_i Phi_i(tree) = 1/density(tree)."""
    weights = stage_weights(tableau, tree)
    return sum(b * w for b, w in zip(tableau.weights, weights, strict=True)) == Fraction(1, density(tree))


def test_the_trees_are_all_there():
    # Butcher's numbers of rooted trees.
    assert [len(trees()[size]) for size in range(1, 6)] == [1, 1, 2, 4, 9]


def test_the_catalogue_lists_every_tableau():
    assert list(TABLEAUX) == list(METHODS)
    assert all(tableau.name == name for name, tableau in TABLEAUX.items())
    assert [tableau.order for tableau in TABLEAUX.values()] == [1, 2, 3, 4]


@TABLEAU
def test_the_method_is_explicit(tableau):
    assert [len(row) for row in tableau.matrix] == list(range(len(tableau.nodes)))
    assert len(tableau.weights) == len(tableau.nodes)


@TABLEAU
def test_row_sums_are_nodes(tableau):
    assert [sum(row, Fraction(0)) for row in tableau.matrix] == list(tableau.nodes)


@TABLEAU
def test_order_conditions_hold_up_to_the_order(tableau):
    assert all(holds(tableau, tree) for size in range(1, tableau.order + 1) for tree in trees()[size])


@TABLEAU
def test_order_conditions_fail_beyond_the_order(tableau):
    assert not all(holds(tableau, tree) for tree in trees()[tableau.order + 1])


def test_the_thesis_methods_are_as_printed():
    half = Fraction(1, 2)
    heun, classical = TABLEAUX["rk2"], TABLEAUX["rk4"]
    assert (heun.matrix, heun.weights) == (((), (1,)), (half, half))
    assert classical.matrix == ((), (half,), (0, half), (0, 0, 1))
    assert classical.weights == (Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6))
