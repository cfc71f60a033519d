"""Sparse polynomials: dictionaries that are rings."""

import math
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.kernel.polynomials import (
    ONE,
    OPERATIONS,
    Polynomial,
    add,
    atom,
    atoms,
    multiply,
    ratio,
    scale,
    substitute,
)

SETTINGS = settings(max_examples=25, derandomize=True, database=None, deadline=None)
NAMES = "xyz"

numbers = st.sampled_from([Fraction(n, d) for n in (-5, -2, -1, 0, 1, 2, 3) for d in (1, 2, 3)])
monomials = st.lists(st.sampled_from(NAMES), max_size=3).map(lambda names: tuple(sorted(names)))
polynomials = st.dictionaries(monomials, numbers.filter(bool), max_size=4)
points = st.fixed_dictionaries({name: numbers for name in NAMES})


def value(p: Polynomial, point: dict[str, Fraction]) -> Fraction:
    return sum((c * math.prod(point[name] for name in m) for m, c in p.items()), Fraction(0))


def is_tidy(p: Polynomial) -> bool:
    """Tell whether equal polynomials would be equal dictionaries."""
    return all(p.values()) and all(list(m) == sorted(m) for m in p)


@SETTINGS
@given(p=polynomials, q=polynomials, factor=numbers.filter(bool), point=points)
def test_sums(p, q, factor, point):
    total = add(p, q, factor)
    assert value(total, point) == value(p, point) + factor * value(q, point)
    assert is_tidy(total)
    assert add(total, q, -factor) == p


def test_operations_of_programs_are_those_of_polynomials():
    one, other = {("a",): Fraction(2)}, {("a",): Fraction(2), ("b",): Fraction(3)}
    assert OPERATIONS["negate"](other) == {("a",): -2, ("b",): -3}
    assert OPERATIONS["add"](one, other) == {("a",): 4, ("b",): 3}
    assert OPERATIONS["subtract"](one, other) == {("b",): -3}
    assert OPERATIONS["multiply"](one, other) == {("a", "a"): 4, ("a", "b"): 6}
    assert "sqrt" not in OPERATIONS


@SETTINGS
@given(p=polynomials, q=polynomials, r=polynomials, point=points)
def test_products(p, q, r, point):
    product = multiply(p, q)
    assert value(product, point) == value(p, point) * value(q, point)
    assert is_tidy(product)
    assert product == multiply(q, p)
    assert multiply(product, r) == multiply(p, multiply(q, r))
    assert multiply(p, ONE) == p
    assert multiply(p, {}) == {}


def test_terms_cancel():
    x, y = atom("x"), atom("y")
    assert multiply(add(x, y), add(x, y, -1)) == {("x", "x"): 1, ("y", "y"): -1}
    assert add(x, x, -1) == {}


@SETTINGS
@given(p=polynomials, factor=numbers, point=points)
def test_multiples(p, factor, point):
    assert value(scale(p, factor), point) == factor * value(p, point)
    assert is_tidy(scale(p, factor))


@SETTINGS
@given(p=polynomials, parts=st.fixed_dictionaries(dict.fromkeys(NAMES, polynomials)), point=points)
def test_substitution(p, parts, point):
    result = substitute(p, parts.__getitem__)
    assert value(result, point) == value(p, {name: value(part, point) for name, part in parts.items()})
    assert is_tidy(result)
    assert substitute(p, atom) == p


def test_atoms_of_several():
    assert atoms([{("x", "y"): Fraction(1)}, {(): Fraction(3)}, {("z", "z"): Fraction(1)}]) == set("xyz")
    # Any kind that can be ordered will do.
    assert atoms([multiply(atom((0, 1)), atom((0, 0)))]) == {(0, 0), (0, 1)}


@SETTINGS
@given(p=polynomials.filter(bool), factor=numbers.filter(bool))
def test_the_ratio_of_proportional_polynomials(p, factor):
    assert ratio(scale(p, factor), p) == factor


@pytest.mark.parametrize(
    ("p", "q"),
    [
        ({("x",): 1, (): 2}, {("x",): 1, (): 3}),
        ({("x",): 1, (): 2}, {("x",): 1}),
        ({("x",): 1}, {("x",): 1, (): 2}),
        ({("x",): 1}, {("y",): 1}),
        ({}, {("y",): 1}),
        ({("y",): 1}, {}),
        ({}, {}),
    ],
)
def test_others_have_no_ratio(p, q):
    exact = [{m: Fraction(c) for m, c in polynomial.items()} for polynomial in (p, q)]
    assert ratio(*exact) is None
