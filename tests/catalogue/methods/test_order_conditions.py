"""Order conditions: trees against the literature, orders against exact series, norms against published ones."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random

import pytest
import sympy as sp

from strapgen.catalogue.methods.order_conditions import (
    attitude_order,
    conditions,
    density,
    embedded_order,
    first_failure,
    order,
    principal_error_norm,
    residuals,
    row_residuals,
    size,
    symmetry,
    trees,
    weight_text,
    word_coefficient,
    words,
)
from strapgen.catalogue.methods.tableaux import TABLEAUX, Tableau

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long

BUILT_IN = pytest.mark.parametrize("name", TABLEAUX)


def fractions(words: str) -> tuple[Fraction, ...]:
    return tuple(map(Fraction, words.split()))


#: Made for this test: all words of order 5 hold, but of the nine trees the one that is no word does not.
LINEAR = Tableau(
    "linear5",
    "of fifth order on linear equations alone",
    "this test",
    4,
    fractions("0 1/5 2/5 3/5 4/5 1"),
    tuple(
        map(
            fractions,
            (
                "",
                "1/5",
                "-9/20 17/20",
                "87/140 -69/140 33/70",
                "3/70 17/70 3/35 3/7",
                "-109/266 335/266 0 -85/133 15/19",
            ),
        )
    ),
    fractions("19/288 25/96 25/144 25/144 25/96 19/288"),
)


# Trees


def test_numbers_of_rooted_trees():
    # Cayley 1857; OEIS A000081.
    assert [len(trees(p)) for p in range(1, 11)] == [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]
    assert all(size(tree) == p for p in range(1, 9) for tree in trees(p))
    assert len({tree for p in range(1, 9) for tree in trees(p)}) == 200


@pytest.mark.parametrize("p", range(1, 11))
def test_trees_have_the_densities_and_symmetries_of_labellings(p):
    # p! / (gamma sigma) is the number of monotonic labellings of a tree, p! / sigma that of all: of all trees
    # together (p - 1)! and p^(p - 1) (Butcher).
    total = math.factorial(p)
    assert sum(Fraction(total, density(t) * symmetry(t)) for t in trees(p)) == math.factorial(p - 1)
    assert sum(Fraction(total, symmetry(t)) for t in trees(p)) == p ** (p - 1)


def test_trees_of_fourth_order_as_in_the_books():
    # Hairer, Norsett, Wanner, table II.2.1.
    assert [(weight_text(tree), density(tree), symmetry(tree)) for tree in trees(4)] == [
        ("sum b_i c_i^3", 4, 6),
        ("sum b_i c_i a_ij c_j", 8, 1),
        ("sum b_i a_ij c_j^2", 12, 2),
        ("sum b_i a_ij a_jk c_k", 24, 1),
    ]
    assert weight_text(()) == "sum b_i"
    assert "sum b_i a_ij c_j a_ik c_k" in map(weight_text, trees(5))


# Orders


@BUILT_IN
def test_conditions_hold_up_to_the_order_and_no_further(name):
    tableau = TABLEAUX[name]
    assert order(tableau) == tableau.order
    assert all(first_failure(tableau, p) is None for p in range(1, tableau.order + 1))
    assert first_failure(tableau, tableau.order + 1) is not None
    assert conditions(tableau) == len(tableau.nodes) + [1, 2, 4, 8, 17, 37, 85, 200][tableau.order - 1]


@BUILT_IN
def test_exact_coefficients_leave_nothing(name):
    tableau = TABLEAUX[name]
    if not tableau.tolerance:
        assert all(r == 0 for r in row_residuals(tableau))
        assert all(r == 0 for p in range(1, tableau.order + 1) for _, r in residuals(tableau, p))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("fehlberg4", 5),
        ("fehlberg5", 4),
        ("dormand-prince5", 4),
        ("fehlberg7", 8),
        ("fehlberg8", 7),
        ("dormand-prince8", 7),
    ],
)
def test_embedded_orders(name, expected):
    assert embedded_order(TABLEAUX[name]) == expected


def test_the_first_failure_is_told_with_its_size():
    assert first_failure(TABLEAUX["midpoint"], 3) == (((), ()), Fraction(1, 4) - Fraction(1, 3))


def test_irrational_residuals_are_exact():
    root = sp.sqrt(21)
    tableau = TABLEAUX["cooper-verner8"]
    off = replace(tableau, weights=(root / 1000 + sp.Rational(1, 20), *tableau.weights[1:]))
    assert first_failure(off, 1) == ((), root / 1000)


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("rk4", "1.4505e-02"),
        ("dormand-prince5", "3.9908e-04"),
        ("fehlberg5", "3.3557e-03"),  # the pair 4(5), carried on with its fifth order
        ("fehlberg4", "1.8392e-03"),
    ],
)
def test_principal_error_norms_are_the_published_ones(name, published):
    # As NodePy lists them.
    assert f"{principal_error_norm(TABLEAUX[name]):.4e}" == published


def test_ralston_has_the_least_error_of_second_order():
    # 1/6 at the node 2/3, against any other node (Ralston 1962).
    assert principal_error_norm(TABLEAUX["ralston2"]) == pytest.approx(1 / 6, rel=1e-15)
    assert principal_error_norm(TABLEAUX["ralston2"]) < min(
        principal_error_norm(TABLEAUX[name]) for name in ("rk2", "midpoint")
    )


# Attitude: x' = A(t) x


@pytest.mark.parametrize("p", range(1, 9))
def test_words_of_an_order(p):
    found = words(p)
    assert len(found) == len(set(found)) == 2 ** (p - 1)
    assert all(sum(word) + len(word) == p for word in found)
    assert set(words(p, 1)) == {word for word in found if max(word) <= 1}


@pytest.mark.parametrize("word", [word for p in range(1, 6) for word in words(p)])
def test_a_word_has_the_coefficient_of_its_iterated_integral(word):
    s = sp.Symbol("s")
    inner = sp.Integer(1)
    for k in reversed(word):
        inner = sp.integrate(s**k * inner, (s, 0, s))
    assert inner.subs(s, 1) == sp.Rational(*word_coefficient(word).as_integer_ratio())


@cache
def rate(degree: int, representation: str) -> list[sp.Matrix]:
    """Return the coefficients of a matrix A(t) that commutes with itself at no other time."""
    random = Random(1969)

    def pick() -> sp.Rational:
        return sp.Rational(random.randint(-9, 9), random.randint(1, 5))

    if representation == "general":
        return [sp.Matrix(3, 3, lambda i, j: pick()) for _ in range(degree + 1)]
    vectors = [[pick() for _ in range(3)] for _ in range(degree + 1)]
    if representation == "direction cosines":
        return [sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]]) for x, y, z in vectors]
    rows = [[[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]] for x, y, z in vectors]
    return [sp.Matrix(row) for row in rows]


def order_in_series(tableau: Tableau, top: int, degree: int, representation: str) -> int:
    """Return the order of one step, carried out on power series of the step length in exact matrices."""
    domain = sp.QQ if tableau.rational else sp.QQ.algebraic_field(sp.sqrt(21))
    A = [
        sp.polys.matrices.DomainMatrix.from_Matrix(m).convert_to(domain) for m in rate(degree, representation)
    ]
    size = A[0].shape[0]
    identity = sp.polys.matrices.DomainMatrix.eye(size, domain)
    zero = identity - identity

    @cache
    def of(value: object) -> object:
        return domain.from_sympy(sp.sympify(value))

    # The solution: (n + 1) X_(n+1) = sum_k A_k X_(n-k).
    X = [identity]
    for n in range(top):
        total = sum((A[k] * X[n - k] for k in range(min(n, degree) + 1)), zero)
        X.append(total * of(sp.Rational(1, n + 1)))
    # The method, each slope times the step: K_i = h A(c_i h) (1 + sum_j a_ij K_j).
    slopes: list[list] = []
    for node, row in zip(tableau.nodes, tableau.matrix, strict=True):
        point = [identity] + [zero] * top
        for a, slope in zip(row, slopes, strict=True):
            if a != 0:
                point = [x + y * of(a) for x, y in zip(point, slope, strict=True)]
        here = [A[k] * of(node) ** k for k in range(degree + 1)]
        slopes.append(
            [zero]
            + [sum((here[k] * point[n - k] for k in range(min(n, degree) + 1)), zero) for n in range(top)]
        )
    result = [identity] + [zero] * top
    for b, slope in zip(tableau.weights, slopes, strict=True):
        result = [x + y * of(b) for x, y in zip(result, slope, strict=True)]
    errors = [(x - y).to_list_flat() for x, y in zip(result, X, strict=True)]
    floor = 1e-9 if tableau.tolerance else 0  # rates of 9 and their powers times the residuals
    return next(
        n - 1 for n, error in enumerate(errors) if any(abs(float(domain.to_sympy(e))) > floor for e in error)
    )


SHORT = [name for name in TABLEAUX if TABLEAUX[name].order < 7]


@pytest.mark.parametrize("name", SHORT)
def test_the_attitude_order_is_that_of_a_step_in_exact_series(name):
    tableau = TABLEAUX[name]
    found = attitude_order(tableau)
    assert found >= tableau.order
    assert order_in_series(tableau, found + 2, found + 1, "general") == found
    for degree in (0, 1, 2):
        limited = attitude_order(tableau, derivatives=degree)
        assert limited >= found
        assert order_in_series(tableau, limited + 2, degree, "general") == limited


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if name == "cooper-verner8" else ())
        for name in TABLEAUX
        if name not in SHORT
    ],
)
def test_the_attitude_order_of_high_orders(name):
    tableau = TABLEAUX[name]
    found = attitude_order(tableau)
    assert order_in_series(tableau, found + 1, found, "general") == found == tableau.order


def test_the_attitude_order_can_exceed_the_classical_one():
    assert (order(LINEAR), attitude_order(LINEAR)) == (4, 5)
    assert all(r == 0 for r in row_residuals(LINEAR))
    failing = [weight_text(tree) for tree, residual in residuals(LINEAR, 5) if residual]
    assert failing == ["sum b_i a_ij c_j a_ik c_k"]
    assert order_in_series(LINEAR, 7, 6, "general") == 5


def test_a_constant_rate_can_be_followed_to_a_higher_order():
    # Jameson's three stages: the exponential to third order, quadrature to second.
    rows = map(fractions, ("", "1/3", "0 1/2"))
    low = Tableau("low3", "-", "-", 2, fractions("0 1/3 1/2"), tuple(rows), fractions("0 0 1"))
    assert [attitude_order(low, k) for k in (None, 0, 1, 2)] == [2, 3, 2, 2]
    assert [order_in_series(low, 4, k, "general") for k in (0, 1, 2)] == [3, 2, 2]
