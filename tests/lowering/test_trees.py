"""How sums, products and polynomials are written down."""

import math
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.ir.program import OPERATIONS, Constant, Node, Operation, Reference, walk
from strapgen.kernel.polynomials import Polynomial
from strapgen.lowering.trees import (
    expanded,
    gathered,
    horner,
    operation_count,
    plain,
)

SETTINGS = settings(max_examples=25, derandomize=True, database=None, deadline=None)
NAMES = "xyz"
x, y, z = map(Reference, NAMES)

numbers = st.sampled_from([Fraction(n, d) for n in (-5, -2, -1, 1, 2, 3) for d in (1, 2, 3)])
monomials = st.lists(st.sampled_from(NAMES), max_size=4).map(lambda names: tuple(sorted(names)))
polynomials = st.dictionaries(monomials, numbers, max_size=6)
points = st.fixed_dictionaries({name: numbers for name in NAMES})


def operation(kind: str, *arguments: Node) -> Operation:
    return Operation(kind, arguments)


def constant(*value: int) -> Constant:
    return Constant(Fraction(*value))


def value(node: Node, point: dict[str, Fraction]) -> Fraction:
    if isinstance(node, Constant):
        return node.value
    if isinstance(node, Reference):
        return point[node.name]
    return OPERATIONS[node.kind](*(value(argument, point) for argument in node.arguments))


def test_equal_coefficients_are_applied_once():
    third, terms = Fraction(1, 3), [(Fraction(1, 3), x), (Fraction(2), y), (Fraction(-1, 3), z)]
    assert gathered(terms) == [
        (True, operation("multiply", constant(1, 3), operation("subtract", x, z))),
        (True, operation("multiply", constant(2), y)),
    ]
    assert gathered([(-third, x), (-third, y)]) == [
        (False, operation("multiply", constant(1, 3), operation("add", x, y)))
    ]


@pytest.mark.parametrize("write", [expanded, horner])
@SETTINGS
@given(p=polynomials, point=points)
def test_a_written_polynomial_has_its_value(write, p, point):
    exact = sum((c * math.prod(point[name] for name in m) for m, c in p.items()), Fraction(0))
    positive, tree = write(p, Reference)
    assert value(tree, point) == (exact if positive else -exact)
    assert value(plain((positive, tree)), point) == exact
    # Numbers carry no signs: these are in the sums.
    assert all(node.value >= 0 for node in walk(tree) if isinstance(node, Constant))


@SETTINGS
@given(p=polynomials)
def test_nested_products_take_no_more_multiplications_than_expanded_ones(p):
    def multiplications(node: Node) -> int:
        return sum(isinstance(n, Operation) and n.kind == "multiply" for n in walk(node))

    # But for the coefficients of several terms, which expanded sums share.
    distinct = {monomial: Fraction(k + 2) for k, monomial in enumerate(p)}
    assert multiplications(horner(distinct, Reference)[1]) <= multiplications(
        expanded(distinct, Reference)[1]
    )


@pytest.mark.parametrize(
    ("p", "operations"),
    [
        ({}, 0),
        ({(): 3}, 0),
        ({("x",): 1}, 0),
        ({("x",): 3, (): 1}, 2),
        ({("x", "x"): 1, ("x",): 1, (): 1}, 3),  # x (x + 1) + 1
        ({("x",) * k: k + 2 for k in range(6)}, 10),
        ({("x", "y"): 1, ("x", "z"): 1, ("y", "z"): 1}, 4),  # x (y + z) + y z
        ({("x", "x", "y"): 1, ("x", "y", "y"): 1}, 3),  # x (y (x + y))
        ({("x", "x"): 5}, 2),
        ({("x", "y"): 2, ("x", "z"): 2}, 3),  # x (2 (y + z))
        # As few as of all terms together with their additions, not of the terms alone, nor the fewest terms.
        ({("x",): 1, ("z", "z"): 1, ("y", "y", "z"): 1, ("y",): 1}, 5),  # z (z + y y) + x + y
        ({("z",): 2, ("w", "x"): 1, ("x", "y"): 1, ("y",): 2}, 5),  # x (w + y) + 2 (z + y)
        (
            {("x", "z", "z"): 1, ("y", "y", "y"): 1, ("x",): 1, ("y", "z", "z"): 2},
            8,
        ),  # z z (x + 2 y) + y y y + x
    ],
)
def test_operations_of_a_horner_scheme(p, operations):
    exact = {monomial: Fraction(c) for monomial, c in p.items()}
    assert operation_count(horner(exact, Reference)[1]) == operations


def test_of_atoms_that_occur_equally_often_the_best_one_is_taken_out():
    # a, b and c occur twice each. The first in the alphabet gives a (b c + d) + b c e: one operation more.
    p: Polynomial = {tuple(monomial): Fraction(1) for monomial in ("abc", "ad", "bce")}
    assert operation_count(horner(p, Reference)[1]) == 5  # b (c (a + e)) + a d


def test_the_atoms_may_be_of_any_kind():
    nodes = {(0, 1): x, (1, 1): y}
    tree = horner({((0, 1), (1, 1)): Fraction(1), ((0, 1),): Fraction(-1)}, nodes.__getitem__)
    assert tree == (True, operation("multiply", x, operation("subtract", y, constant(1))))
