"""The choice of scalar products: what they stand for stays, and polynomials become shorter."""

import itertools
import math
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.kernel.polynomials import Polynomial, atoms
from strapgen.lowering.canonical.vectors import Form, choose_products

SETTINGS = settings(max_examples=25, derandomize=True, database=None, deadline=None)

#: What vectors may be called; the first ones are a basis.
OFFERED: dict[int, dict[str, tuple[int, ...]]] = {
    2: {"a": (1, 0), "b": (0, 1), "a_plus_b": (1, 1), "a_minus_b": (1, -1), "twice": (1, 2)},
    3: {"a": (1, 0, 0), "b": (0, 1, 0), "c": (0, 0, 1), "sum": (1, 1, 1), "a_minus_c": (1, 0, -1)},
}

numbers = st.sampled_from([Fraction(n, d) for n in (-2, -1, 1, 3) for d in (1, 2)])
components = st.sampled_from([Fraction(n) for n in (-3, -1, 0, 2, 5)])
vectors = st.lists(st.tuples(components, components, components), min_size=3, max_size=3)


def forms(count: int) -> dict[str, Form]:
    return {name: tuple(map(Fraction, form)) for name, form in OFFERED[count].items()}


def families(count: int) -> st.SearchStrategy[list[Polynomial]]:
    """Polynomials in scalar products, and triple products, of the basis."""
    products = [
        *itertools.combinations_with_replacement(range(count), 2),
        *itertools.combinations(range(count), 3),
    ]
    monomials = st.lists(st.sampled_from(products), max_size=3).map(lambda m: tuple(sorted(m)))
    return st.lists(st.dictionaries(monomials, numbers, max_size=5), max_size=3)


def value(p: Polynomial, vectors: dict) -> Fraction:
    def product(factor) -> Fraction:
        u, v, *w = (vectors[name] for name in factor)
        if w:
            v = tuple(v[i] * w[0][j] - v[j] * w[0][i] for i, j in ((1, 2), (2, 0), (0, 1)))
        return sum((x * y for x, y in zip(u, v, strict=True)), Fraction(0))

    return sum((c * math.prod(map(product, m)) for m, c in p.items()), Fraction(0))


def cost(polynomials: list[Polynomial]) -> int:
    """Return what the choice is made by: factors of terms, and three operations for every product."""
    distinct = {frozenset(p.items()): p for p in polynomials}.values()
    return sum(len(m) for p in distinct for m in p) + 3 * len(atoms(polynomials))


@SETTINGS
@given(data=st.data(), points=vectors)
def test_a_choice_keeps_every_value(data, points):
    count = data.draw(st.sampled_from([2, 3]))
    polynomials, offered = data.draw(families(count)), forms(count)
    chosen = choose_products(polynomials, list(offered.items())[:count], offered)
    basis = dict(enumerate(points[:count]))
    named = {
        name: tuple(
            sum(c * x for c, x in zip(form, axis, strict=True)) for axis in zip(*points[:count], strict=True)
        )
        for name, form in offered.items()
    }
    assert [value(p, named) for p in chosen] == [value(p, basis) for p in polynomials]


@SETTINGS
@given(data=st.data())
def test_a_choice_never_costs_more(data):
    count = data.draw(st.sampled_from([2, 3]))
    polynomials, offered = data.draw(families(count)), forms(count)
    chosen = choose_products(polynomials, list(offered.items())[:count], offered)
    assert cost(chosen) <= cost(polynomials)


def test_a_hidden_square_is_found():
    # a.a + 2 a.b + b.b is (a + b).(a + b)
    offered = forms(2)
    square: Polynomial = {((0, 0),): Fraction(1), ((0, 1),): Fraction(2), ((1, 1),): Fraction(1)}
    assert choose_products([square], list(offered.items())[:2], offered) == [
        {(("a_plus_b", "a_plus_b"),): Fraction(1)}
    ]


def test_a_difference_of_squares_is_found():
    offered = forms(2)
    difference: Polynomial = {((0, 0),): Fraction(1, 3), ((1, 1),): Fraction(-1, 3), (): Fraction(2)}
    assert choose_products([difference], list(offered.items())[:2], offered) == [
        {(("a_plus_b", "a_minus_b"),): Fraction(1, 3), (): Fraction(2)}
    ]


def test_without_other_vectors_nothing_is_exchanged():
    offered = forms(2)
    basis = list(offered.items())[:2]
    square: Polynomial = {((0, 0),): Fraction(1), ((0, 1),): Fraction(2), ((1, 1),): Fraction(1)}
    assert choose_products([square], basis, dict(basis)) == [
        {(("a", "a"),): Fraction(1), (("a", "b"),): Fraction(2), (("b", "b"),): Fraction(1)}
    ]


def test_numbers_need_no_products():
    offered = forms(2)
    assert choose_products([{(): Fraction(3)}, {}], list(offered.items())[:2], offered) == [{(): 3}, {}]
