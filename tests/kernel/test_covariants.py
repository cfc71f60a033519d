"""Decompositions: transitions as sums of vectors, cross products and outer products with scalar weights."""

import itertools
import math
from fractions import Fraction
from functools import cache

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen import derive
from strapgen.kernel.covariants import Decomposition, Frame, NotCovariantError, invariants, transform
from strapgen.kernel.polynomials import ONE, Polynomial, add, multiply, scale
from strapgen.lowering.canonical.core import Core, decompose, extract
from strapgen.lowering.canonical.plan import without_triples
from strapgen.lowering.canonical.vectors import components

SETTINGS = settings(max_examples=25, derandomize=True, database=None, deadline=None)
Vector = tuple[Fraction, ...]

numbers = st.sampled_from([Fraction(n, d) for n in (-5, -3, -1, 0, 1, 2, 4) for d in (1, 2, 3)])
vectors = st.lists(st.tuples(numbers, numbers, numbers), min_size=3, max_size=3)


def q(*value: int) -> Fraction:
    return Fraction(*value)


def dot(a: Vector, b: Vector) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def cross(a: Vector, b: Vector) -> Vector:
    return tuple(a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1)))


def combination(coefficients: list[Fraction], of: list[Vector]) -> Vector:
    return tuple(dot(coefficients, column) for column in zip(*of, strict=True))


def value(p: Polynomial, u: list[Vector]) -> Fraction:
    """Return a polynomial in scalar and triple products, (i, j) and (i, j, k)."""

    def product(factor: tuple[int, ...]) -> Fraction:
        i, j, *k = factor
        return dot(u[i], cross(u[j], u[k[0]]) if k else u[j])

    return sum((c * math.prod(map(product, monomial)) for monomial, c in p.items()), Fraction(0))


def vector(decomposition: Decomposition, u: list[Vector]) -> Vector:
    total = (Fraction(0),) * 3
    for (i, *j), p in decomposition.vector.items():
        part, weight = cross(u[i], u[j[0]]) if j else u[i], value(p, u)
        total = tuple(x + weight * y for x, y in zip(total, part, strict=True))
    return total


def matrix(decomposition: Decomposition, u: list[Vector]) -> list[Fraction]:
    """Return a matrix row by row."""
    x, y, z = vector(decomposition, u)
    total = [Fraction(0), -z, y, z, Fraction(0), -x, -y, x, Fraction(0)]
    for covariant, p in decomposition.symmetric.items():
        weight = value(p, u)
        for row, column in itertools.product(range(3), repeat=2):
            if covariant:
                a = u[covariant[0]]
                b = u[covariant[1]] if len(covariant) == 2 else cross(u[covariant[1]], u[covariant[2]])
                part = a[row] * b[column] + b[row] * a[column]
            else:
                part = Fraction(row == column)
            total[3 * row + column] += weight * part
    return total


@cache
def core(algorithm: str, method: str, increments: int) -> Core:
    return extract(derive(algorithm, method=method, increments=increments))


def in_basis(algorithm: str, *basis: tuple[int, ...]) -> Decomposition:
    """Return the classical fourth-order step from two increments in vectors given by their coefficients."""
    made = core(algorithm, "rk4", 2)
    forms = [tuple(map(Fraction, form)) for form in basis]
    return transform(decompose(made), [components(form, forms) for form in made.base()])


def test_the_fourth_order_step_of_euler_parameters():
    # By hand, with sigma = d1 + d2, A = sigma . sigma, G = d1 . d2:
    #   vector part (1/2 - A/48) sigma + (1/3 - A/48) d1 x d2, scalar part 1 + A (G/24 - A/128 - 1/8)
    A = {((0, 0),): q(1), ((0, 1),): q(2), ((1, 1),): q(1)}
    G = {((0, 1),): q(1)}
    along = add(scale(ONE, q(1, 2)), A, q(-1, 48))
    inner = add(add(scale(G, q(1, 24)), A, q(-1, 128)), ONE, q(-1, 8))
    assert in_basis("euler", (1, 0), (0, 1)) == Decomposition(
        scalar=add(ONE, multiply(A, inner)),
        vector={(0,): along, (1,): along, (0, 1): add(scale(ONE, q(1, 3)), A, q(-1, 48))},
        symmetric={},
    )


def test_the_fourth_order_step_of_direction_cosines():
    # By hand, with sigma = d1 + d2, delta = d1 - d2, A = sigma . sigma, B = sigma . delta, D = delta . delta:
    #   I + skew[(1 - A/6) sigma + (A - 4)/12 sigma x delta] + sigma y' + y sigma' + mu I
    #   y = (1/4 - A/48 - D/12) sigma + B/6 delta - 1/6 sigma x delta,  mu = -A/2 + A^2/24 - B^2/6
    a, b, d = (0, 0), (0, 1), (1, 1)
    assert in_basis("dcm", (1, 1), (1, -1)) == Decomposition(
        scalar=None,
        vector={(0,): {(): q(1), (a,): q(-1, 6)}, (0, 1): {(): q(-4, 12), (a,): q(1, 12)}},
        symmetric={
            (): {(): q(1), (a,): q(-1, 2), (a, a): q(1, 24), (b, b): q(-1, 6)},
            (0, 0): {(): q(1, 4), (a,): q(-1, 48), (d,): q(-1, 12)},
            (0, 1): {(b,): q(1, 6)},
            (0, 0, 1): {(): q(-1, 6)},
        },
    )


@pytest.mark.parametrize(
    ("algorithm", "method", "increments"),
    [
        ("euler", "rk4", 3),
        ("cayley-klein", "rk3", 2),
        ("dcm", "rk3", 3),
        ("dcm", "rk4", 4),
        ("dcm", "rk2", 1),
    ],
)
def test_a_decomposition_has_the_value_of_the_step(algorithm, method, increments):
    made = core(algorithm, method, increments)
    decomposition = decompose(made)
    inputs = [tuple(q(n * k + 1, 7 - n) for n in (2, 3, 5)) for k in (3, -2, 5, -4)][:increments]
    values = {
        element: x
        for signal, form in made.vectors.values()
        for element, x in zip(signal.elements, combination(list(form), inputs), strict=True)
    }
    expected = made.evaluate({name: sp.Rational(x.numerator, x.denominator) for name, x in values.items()})
    base = [combination(list(form), inputs) for form in made.base()]
    if made.transition.shape == (3, 3):
        assert matrix(decomposition, base) == expected
    else:
        found = dict(
            zip("xyzs", [*vector(decomposition, base), value(decomposition.scalar, base)], strict=True)
        )
        assert [found[element[-1]] for element in made.transition.elements] == expected


def test_products_of_two_vectors():
    frame = Frame(2)
    u, v = frame.vectors
    crossed = [u[i] * v[j] - u[j] * v[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    length = v[0] * v[0] + v[1] * v[1]
    assert frame.quaternion([3 * x * length for x in crossed], 5 * u[0] * v[0]) == Decomposition(
        scalar={((0, 1),): q(5)}, vector={(0, 1): {((1, 1),): q(3)}}, symmetric={}
    )


def test_the_product_of_two_skew_matrices():
    # u x (v x w) = v (u . w) - (u . v) w: the matrix is v u' - (u . v) I, and v u' - u v' is skew in u x v.
    frame = Frame(2)
    u, v = ([[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in frame.vectors)
    product = [frame.ring(sum(u[i][k] * v[k][j] for k in range(3))) for i in range(3) for j in range(3)]
    assert frame.matrix(product) == Decomposition(
        scalar=None,
        vector={(0, 1): {(): q(1, 2)}},
        symmetric={(0, 1): {(): q(1, 2)}, (): {((0, 1),): q(-1)}},
    )


def test_a_triple_product_is_a_scalar():
    frame = Frame(3)
    u, v, w = frame.vectors
    triple = u[0] * v[1] * w[2]  # u along x, v in the xy plane
    assert frame.quaternion([frame.ring.zero] * 3, triple).scalar == {((0, 1, 2),): q(1)}


def test_functions_that_are_not_covariant_are_refused():
    one, two = Frame(1), Frame(2)
    zero = one.ring.zero
    (x, _, _), (u, v) = one.vectors[0], two.vectors
    for elements, scalar in (
        ([x * x, zero, zero], zero),  # a vector of even degree
        ([zero, x, zero], zero),  # across
        ([zero] * 3, x),  # a scalar of odd degree
    ):
        with pytest.raises(NotCovariantError):
            one.quaternion(elements, scalar)
    with pytest.raises(NotCovariantError):
        two.quaternion([two.ring.zero] * 3, u[0] * v[1])
    with pytest.raises(NotCovariantError, match=r"degree \(1,\)"):
        one.matrix([x, *[zero] * 8])
    with pytest.raises(NotCovariantError):
        one.matrix([zero, x, zero, x, *[zero] * 5])


@pytest.mark.parametrize(
    ("degree", "triple", "count"),
    [
        ((0,), False, 1),
        ((4,), False, 1),
        ((3,), False, 0),
        ((2, 2), False, 2),  # (0.0)(1.1), (0.1)^2
        ((3, 1), False, 1),
        ((2, 1), False, 0),
        ((2, -1), False, 0),
        ((1, 1, 1, 1), False, 3),
        ((1, 1, 1), False, 0),
        ((1, 1, 1), True, 1),
        ((3, 1, 1), True, 1),
        ((2, 1), True, 0),
        ((1, 1), True, 1),
    ],
)
def test_number_of_products_of_a_degree(degree, triple, count):
    found = invariants(degree, triple)
    assert len(found) == len(set(found)) == count
    for monomial in found:
        counted = [sum(factor.count(k) for factor in monomial) for k in range(len(degree))]
        assert tuple(counted) == degree


def polynomials(count: int) -> st.SearchStrategy[Polynomial]:
    pairs = [
        *itertools.combinations_with_replacement(range(count), 2),
        *itertools.combinations(range(count), 3),
    ]
    monomials = st.lists(st.sampled_from(pairs), max_size=2).map(lambda m: tuple(sorted(m)))
    return st.dictionaries(monomials, numbers.filter(bool), min_size=1, max_size=2)


@st.composite
def decompositions(draw: st.DrawFn, count: int) -> Decomposition:
    singles = [(i,) for i in range(count)]
    pairs = list(itertools.combinations(range(count), 2))
    squares = list(itertools.combinations_with_replacement(range(count), 2))
    triples = [(i, *pair) for i in range(count) for pair in pairs]

    def coefficients(covariants: list) -> dict:
        return draw(st.dictionaries(st.sampled_from(covariants), polynomials(count), max_size=3))

    return Decomposition(
        draw(polynomials(count)), coefficients(singles + pairs), coefficients([(), *squares, *triples])
    )


@st.composite
def bases(draw: st.DrawFn, count: int) -> list[list[Fraction]]:
    """Vectors along others: a permuted triangle, so that they are independent."""
    rows = [
        [
            draw(numbers) if j < i else draw(numbers.filter(bool)) if j == i else Fraction(0)
            for j in range(count)
        ]
        for i in range(count)
    ]
    return draw(st.permutations(rows))


@pytest.mark.long
@pytest.mark.parametrize("count", [2, 3])
@SETTINGS
@given(data=st.data())
def test_other_vectors_and_back(count, data):
    decomposition, rows = data.draw(decompositions(count)), data.draw(bases(count))
    units = [tuple(Fraction(i == j) for j in range(count)) for i in range(count)]
    back = [components(unit, [tuple(row) for row in rows]) for unit in units]
    assert transform(transform(decomposition, rows), back) == decomposition


@pytest.mark.long
@pytest.mark.parametrize("count", [2, 3])
@SETTINGS
@given(data=st.data(), new=vectors)
def test_other_vectors_leave_the_value(count, data, new):
    decomposition, rows = data.draw(decompositions(count)), data.draw(bases(count))
    new = new[:count]
    old = [combination(row, new) for row in rows]
    moved = transform(decomposition, rows)
    assert value(moved.scalar, new) == value(decomposition.scalar, old)
    assert vector(moved, new) == vector(decomposition, old)
    assert matrix(moved, new) == matrix(decomposition, old)


@SETTINGS
@given(u=vectors)
def test_the_relation_between_symmetrized_triple_products(u):
    # u1 (u2 x u3)' + u2 (u3 x u1)' + u3 (u1 x u2)', symmetrized, is twice the triple product times I.
    cyclic = Decomposition(None, {}, {(0, 1, 2): ONE, (1, 0, 2): scale(ONE, -1), (2, 0, 1): ONE})
    triple = Decomposition(None, {}, {(): {((0, 1, 2),): q(2)}})
    assert matrix(cyclic, u) == matrix(triple, u)


@SETTINGS
@given(decomposition=decompositions(3), u=vectors)
def test_exchanging_a_triple_product_leaves_the_value(decomposition, u):
    variants = without_triples(decomposition)
    assert variants
    for variant in variants:
        assert matrix(variant, u) == matrix(decomposition, u)


@pytest.mark.parametrize("covariant", [(0, 1, 2), (1, 0, 2), (2, 0, 1)])
def test_a_triple_product_is_exchanged_where_that_saves_an_axis(covariant):
    p = {((0, 1),): q(3)}
    squares: dict = {(k, k): ONE for k in range(3) if k != covariant[0]}
    (other,) = without_triples(Decomposition(None, {}, {covariant: p} | squares))
    assert {c for c in other.symmetric if len(c) == 3} == {(0, 1, 2), (1, 0, 2), (2, 0, 1)} - {covariant}
    assert {c: other.symmetric[c] for c in squares} == squares


@pytest.mark.parametrize("covariant", [(0, 1, 2), (1, 0, 2), (2, 0, 1)])
def test_a_triple_product_stays_where_it_is_on_an_axis(covariant):
    alone = Decomposition(None, {}, {covariant: ONE, (covariant[0],) * 2: ONE})
    assert without_triples(alone) == [alone]
    # ... and is tried both ways where all are axes.
    every = Decomposition(None, {}, {covariant: ONE} | {(k, k): ONE for k in range(3)})
    same, other = without_triples(every)
    assert same == every
    assert covariant not in other.symmetric


def test_triple_products_of_two_vectors_stay():
    decomposition = Decomposition(None, {(0,): ONE}, {(0, 0, 1): ONE, (1, 0, 1): ONE, (0, 1): ONE, (): ONE})
    assert without_triples(decomposition) == [decomposition]
