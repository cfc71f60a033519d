"""Vectors that are linear in the inputs: each defined once, with few operations."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.kernel.polynomials import ONE, Polynomial, atoms
from strapgen.lowering.canonical.plan import _axes
from strapgen.lowering.canonical.vectors import (
    Form,
    Pool,
    choose_products,
    components,
    independent,
    mirrored,
    normalized,
    proportion,
)

SETTINGS = settings(max_examples=25, derandomize=True, database=None, deadline=None)

numbers = st.sampled_from([Fraction(n, d) for n in (-3, -1, 0, 0, 1, 2) for d in (1, 2)])
#: Several forms in the same inputs.
families = st.integers(1, 5).flatmap(
    lambda n: st.lists(st.tuples(*[numbers] * n).filter(any), min_size=1, max_size=5)
)


THIRD = Fraction(1, 3)


def form(*coefficients: int | Fraction) -> Form:
    return tuple(map(Fraction, coefficients))


def pool(count: int, names: dict[Form, tuple[str, str]] | None = None) -> Pool:
    return Pool([f"d{k}" for k in range(1, count + 1)], names or {})


def computed(made: Pool) -> dict[str, Form]:
    """Return the forms of all vectors as their parts give them."""
    count = len(next(iter(made.vectors.values())).form)
    forms: dict[str, Form] = {}
    for name, vector in made.vectors.items():
        parts = [[c * x for x in forms[part]] for c, part in vector.parts]
        forms[name] = tuple(map(sum, zip(*parts, strict=True))) if parts else vector.form
        assert len(forms[name]) == count
    return forms


@pytest.mark.parametrize(
    ("a", "b", "c"),
    [
        ((2, -4, 0), (1, -2, 0), 2),
        ((0, 3), (0, -2), Fraction(-3, 2)),
        ((1, 1), (1, -1), None),
        ((1, 0), (1, 1), None),
        ((0, 1), (1, 0), None),
        ((0, 0), (1, 2), None),
        ((1, 2), (0, 0), None),
    ],
)
def test_the_proportion_of_two_forms(a, b, c):
    assert proportion(form(*a), form(*b)) == c


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((2, -2, 1), (1, -1, Fraction(1, 2))),  # most coefficients are one
        ((-3, -1), (1, Fraction(1, 3))),  # of several as frequent the largest, the first positive
        ((0, Fraction(-1, 2), Fraction(1, 2)), (0, 1, -1)),
    ],
)
def test_normalized_forms(before, after):
    assert normalized(form(*before)) == form(*after)


@SETTINGS
@given(family=families)
def test_a_base_spans_every_form(family):
    base = [family[k] for k in independent(family)]
    for whole in family:
        along = components(whole, base)
        parts = [[c * x for x in part] for c, part in zip(along, base, strict=True)]
        assert tuple(map(sum, zip(*parts, strict=True))) == whole
    # ... with no form to spare.
    assert independent(base) == list(range(len(base)))
    assert len(base) <= len(family[0])


def test_the_first_independent_forms_are_taken():
    assert independent([form(1, 1), form(2, 2), form(0, 0), form(1, 0), form(0, 1)]) == [0, 3]


def test_a_form_outside_the_span_has_no_components():
    with pytest.raises(ValueError, match="span"):
        components(form(0, 0, 1), [form(1, 0, 0), form(0, 1, 0)])


def test_a_proportional_vector_is_found():
    made = pool(3)
    assert made.find(form(0, Fraction(-1, 2), 0)) == ("d2", Fraction(-1, 2))
    assert made.find(form(1, 1, 0)) is None
    name, _ = made.define(form(2, 2, 4))
    assert made.find(form(-1, -1, -2)) == (name, -made.find(form(1, 1, 2))[1])


def test_a_form_is_defined_once():
    made = pool(2)
    first = made.define(form(1, 1))
    assert first == ("d1_plus_d2", 1)
    assert made.define(form(-3, -3)) == ("d1_plus_d2", -3)
    assert list(made.vectors) == ["d1", "d2", "d1_plus_d2"]


@SETTINGS
@given(family=families, halves=st.booleans())
def test_every_vector_is_the_sum_of_its_parts(family, halves):
    made = pool(len(family[0]))
    if halves:
        made.define_mirrored(family[0])
    for whole in family:
        name, factor = made.define(whole)
        assert tuple(factor * x for x in made.vectors[name].form) == whole
    # Parts come before what they are parts of, or this would fail too.
    assert computed(made) == {name: vector.form for name, vector in made.vectors.items()}
    assert [vector.name for vector in made.vectors.values()] == list(made.vectors)


@SETTINGS
@given(family=families)
def test_no_two_vectors_are_proportional(family):
    made = pool(len(family[0]))
    for whole in family:
        made.define(whole)
    forms = [vector.form for vector in made.vectors.values()]
    for k, a in enumerate(forms):
        assert not [b for b in forms[k + 1 :] if proportion(a, b) is not None]


def test_a_sum_of_two_named_vectors_takes_three_additions():
    made = pool(3)
    made.define(form(1, 1, 0))
    name, _ = made.define(form(1, 1, -1))
    assert set(made.vectors[name].parts) == {(1, "d1_plus_d2"), (-1, "d3")}
    assert made.vectors[name].operations == 3


@pytest.mark.parametrize(
    ("whole", "parts", "operations"),
    [
        # (d1 + d4) + (d2 + d3)/3: two sums, a multiple and a sum
        ((1, THIRD, THIRD, 1), {(1, "d1_plus_d4"), (THIRD, "d2_plus_d3")}, 12),
        ((1, -THIRD, THIRD, -1), {(1, "d1_minus_d4"), (-THIRD, "d2_minus_d3")}, 12),
        ((1, 2, 1), {(1, "d1_plus_d3"), (2, "d2")}, 9),
        ((1, 0, 2, 0, 1), {(1, "d1_plus_d5"), (2, "d3")}, 9),
    ],
)
def test_forms_that_are_even_or_odd_in_time_go_through_pairs(whole, parts, operations):
    made = pool(len(whole))
    name, factor = made.define(form(*whole))
    assert factor == 1
    assert set(made.vectors[name].parts) == parts
    assert made.operations([name]) == operations


def test_other_forms_are_sums_of_inputs():
    made = pool(3)
    name, _ = made.define(form(1, 2, 3))
    assert {part for _, part in made.vectors[name].parts} == {"d1", "d2", "d3"}
    assert made.operations([name]) == 3 * (2 + 2)


def test_mirror_images_are_the_sum_and_the_difference_of_two_halves():
    made = pool(4)
    start = tuple(Fraction(n, 12) for n in (25, -23, 13, -3))
    made.define_mirrored(start)
    first, second = made.find(start)[0], made.find(mirrored(start))[0]
    (one, even), (plus, odd) = made.vectors[first].parts
    assert made.vectors[second].parts == ((1, even), (-1, odd))
    assert (one, plus) == (1, 1)
    assert made.vectors[even].form == mirrored(made.vectors[even].form)
    assert made.vectors[odd].form == tuple(-x for x in mirrored(made.vectors[odd].form))
    # That is the point of it: alone each would be a sum of four with three multiples.
    alone = pool(4)
    names = [alone.define(start)[0], alone.define(mirrored(start))[0]]
    assert made.operations([first, second]) < alone.operations(names)


@pytest.mark.parametrize("whole", [(1, 2, 1), (1, 0, -1), (2, -1, -1, 2)])
def test_a_form_that_is_its_own_mirror_image_has_no_halves(whole):
    made = pool(len(whole))
    made.define_mirrored(form(*whole))
    assert len(made.vectors) == len(whole)


def test_only_vectors_that_are_needed_are_counted():
    made = pool(4)
    pair, _ = made.define(form(1, 1, 0, 0))
    whole, _ = made.define(form(1, 1, 1, 0))
    other, _ = made.define(form(0, 0, 1, -1))
    assert made.operations([]) == made.operations(["d1", "d4", "elsewhere"]) == 0
    assert made.operations([pair]) == 3
    assert made.operations([whole]) == made.operations([whole, pair, whole]) == 6  # through the pair
    assert made.operations([whole, other]) == 9


def test_a_copy_goes_its_own_way():
    made = pool(2)
    other = made.copy()
    other.define(form(1, 1))
    assert list(made.vectors) == ["d1", "d2"]
    assert other.copy().vectors == other.vectors


def test_vectors_get_their_standard_names():
    made = pool(2, {form(1, 1): ("sigma", "the whole step")})
    assert made.define(form(2, 2)) == ("sigma", 2)
    assert made.vectors["sigma"].meaning == "the whole step"


def test_multiple_of_a_named_vector_is_recognized():
    made = pool(2, {form(3, -1): ("turn_0", "rate at the start")})
    assert made.define(form(3, -1)) == ("turn_0_scaled", 3)
    assert made.vectors["turn_0_scaled"].meaning == "rate at the start, times 1/3"
    assert made.vectors["turn_0_scaled"].form == form(1, Fraction(-1, 3))


def test_combinations_without_a_name_say_whether_they_are_even_or_odd():
    made = pool(4)
    for whole, name in (((1, 3, 3, 1), "even"), ((1, 5, 5, 1), "even_2"), ((1, 3, -3, -1), "odd")):
        assert made.define(form(*whole))[0] == name
    assert made.define(form(1, 2, 3, 4))[0] == "mixed"


#: What vectors may be called; the first ones are a basis.
OFFERED: dict[int, dict[str, tuple[int, ...]]] = {
    2: {"a": (1, 0), "b": (0, 1), "a_plus_b": (1, 1), "a_minus_b": (1, -1), "twice": (1, 2)},
    3: {"a": (1, 0, 0), "b": (0, 1, 0), "c": (0, 0, 1), "sum": (1, 1, 1), "a_minus_c": (1, 0, -1)},
}

nonzero = st.sampled_from([Fraction(n, d) for n in (-2, -1, 1, 3) for d in (1, 2)])
entries = st.sampled_from([Fraction(n) for n in (-3, -1, 0, 2, 5)])
vectors = st.lists(st.tuples(entries, entries, entries), min_size=3, max_size=3)


def forms(count: int) -> dict[str, Form]:
    return {name: tuple(map(Fraction, form)) for name, form in OFFERED[count].items()}


def polynomials_in(count: int) -> st.SearchStrategy[list[Polynomial]]:
    """Polynomials in scalar products, and triple products, of the basis."""
    products = [
        *itertools.combinations_with_replacement(range(count), 2),
        *itertools.combinations(range(count), 3),
    ]
    monomials = st.lists(st.sampled_from(products), max_size=3).map(lambda m: tuple(sorted(m)))
    return st.lists(st.dictionaries(monomials, nonzero, max_size=5), max_size=3)


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
    polynomials, offered = data.draw(polynomials_in(count)), forms(count)
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
    polynomials, offered = data.draw(polynomials_in(count)), forms(count)
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


@pytest.mark.parametrize(
    ("products", "axes"),
    [
        ([], []),
        ([(0,), (0, 1)], [0]),  # a pair may begin with either: the first
        ([(0, 1), (1, 2), (1, 3)], [1]),  # one vector begins all of them
        ([(0, 2), (0, 3), (1, 2), (1, 3), (1, 4)], [0, 1]),  # 1 begins most, and 0 the others
        ([(2, 2), (0, 2)], [2]),  # a square has no choice
        ([(2, 0, 1), (0, 2), (0, 1)], [0, 2]),  # nor the product of a vector and a cross product
    ],
)
def test_outer_products_begin_with_few_vectors(products, axes):
    assert _axes({product: ONE for product in products}) == axes
