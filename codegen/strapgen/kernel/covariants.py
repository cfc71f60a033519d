"""Decomposition of a transition that commutes with rotations of its inputs into scalar and cross products of them.

Its scalars are polynomials in the scalar products (and triple products) of the vectors; its vectors are sums of
vectors and cross products with such coefficients, its symmetric matrices sums of the unit matrix and of symmetrized
products of two vectors. The coefficients follow from one small linear system for every degree in each vector, in a
rotated frame whose x axis lies along the first vector and whose xy plane contains the second.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from strapgen.kernel.algebra import cross_elements, dot, exact
from strapgen.kernel.polynomials import ONE, Monomial, Polynomial, add, substitute

#: The covariant that a coefficient multiplies: () is a scalar or the unit matrix; (i,) is vector i; (i, j) is the cross
#: product i x j in a vector and the symmetrized product of i and j in a matrix; (i, j, k) is the symmetrized product
#: of i and j x k.
Covariant = tuple[int, ...]
#: The coefficient of every covariant, a polynomial in the products (i, j) = i . j and (i, j, k) = i . (j x k).
Coefficients = dict[Covariant, Polynomial]

_Degree = tuple[int, ...]
#: Yields the covariants that may stand at a degree, each with its elements and the degree left for its products.
_Ansatz = Callable[[_Degree], Iterator[tuple[Covariant, list[Any], _Degree]]]
#: Covariants with products, and by each monomial of each element the coefficients that it has in them.
_Products = tuple[list[tuple[Covariant, Monomial]], dict[Any, dict[int, Any]]]

#: The unit matrix as the elements xx, xy, xz, yy, yz, zz.
_UNIT = [1, 0, 0, 1, 0, 1]


class NotCovariantError(ValueError):
    """A transition does not commute with rotations of its inputs."""


@dataclass(frozen=True)
class Decomposition:
    """A transition as coefficients of covariants."""

    scalar: Polynomial | None  # of a quaternion; None for a matrix
    vector: Coefficients  # of a quaternion, or of a matrix's skew part
    symmetric: Coefficients  # part of a matrix; empty for a quaternion

    def coefficients(self) -> list[Polynomial]:
        """Return all polynomials."""
        scalars = [] if self.scalar is None else [self.scalar]
        return [*scalars, *self.vector.values(), *self.symmetric.values()]

    def evaluate(self, vectors: list[list[Any]]) -> list[Any]:
        """Return the elements (x, y, z, s, or row by row) for vectors of numbers or polynomials."""

        def value(polynomial: Polynomial) -> Any:
            total: Any = 0
            for monomial, coefficient in polynomial.items():
                product: Any = exact(coefficient)
                for i, j, *k in monomial:
                    other = cross_elements(vectors[j], vectors[k[0]]) if k else vectors[j]
                    product = dot(vectors[i], other) * product
                total = product + total
            return total

        v: list[Any] = [0, 0, 0]
        for (i, *j), polynomial in self.vector.items():
            vector = cross_elements(vectors[i], vectors[j[0]]) if j else vectors[i]
            v = [a + b * value(polynomial) for a, b in zip(v, vector, strict=True)]
        if self.scalar is not None:
            return [*v, value(self.scalar)]
        s: list[Any] = [0] * 6
        for covariant, polynomial in self.symmetric.items():
            product: list[Any] = list(_UNIT)
            if covariant:
                first, *rest = covariant
                other = (
                    cross_elements(vectors[rest[0]], vectors[rest[1]]) if len(rest) == 2 else vectors[rest[0]]
                )
                product = _symmetrize(vectors[first], other)
            s = [a + b * value(polynomial) for a, b in zip(s, product, strict=True)]
        xx, xy, xz, yy, yz, zz = s
        x, y, z = v
        return [xx, xy - z, xz + y, xy + z, yy, yz - x, xz - y, yz + x, zz]


class Frame:
    """Vectors in a rotated frame, as polynomials in those coordinates that are not zero in it."""

    def __init__(self, count: int) -> None:
        self.count = count
        lengths = [min(k + 1, 3) for k in range(count)]
        names = [f"u{k}_{axis}" for k, n in enumerate(lengths) for axis in "xyz"[:n]]
        self.ring, *generators = sp.ring(names, sp.QQ)
        coordinates = iter(generators)
        self.vectors = [[next(coordinates) for _ in range(n)] + [self.ring.zero] * (3 - n) for n in lengths]
        self._owner = [k for k, n in enumerate(lengths) for _ in range(n)]
        self._values: dict[Monomial, Any] = {(): self.ring.one}
        self._known: dict[tuple[str, _Degree], _Products] = {}

    def quaternion(self, vector: list[Any], scalar: Any) -> Decomposition:
        """Decompose a quaternion whose elements are polynomials in the coordinates of the frame."""
        return Decomposition(self._solve([scalar], self._scalars).get((), {}), self._vector(vector), {})

    def matrix(self, m: list[Any]) -> Decomposition:
        """Decompose a 3 x 3 matrix, row by row, whose elements are polynomials in the coordinates of the frame."""
        half = sp.Rational(1, 2)
        skew = [(m[7] - m[5]) * half, (m[2] - m[6]) * half, (m[3] - m[1]) * half]
        symmetric = [(m[3 * i + j] + m[3 * j + i]) * half for i in range(3) for j in range(i, 3)]
        return Decomposition(None, self._vector(skew), self._solve(symmetric, self._symmetrics))

    def _vector(self, elements: list[Any]) -> Coefficients:
        return self._solve(elements, self._vectors)

    def _scalars(self, degree: _Degree) -> Iterator[tuple[Covariant, list[Any], _Degree]]:
        yield (), [self.ring.one], degree

    def _vectors(self, degree: _Degree) -> Iterator[tuple[Covariant, list[Any], _Degree]]:
        # Scalar products have an even degree, so odd degrees need vectors and even degrees cross products. Triple
        # products would add nothing: (a . b x c) d is a sum of cross products, (a . b x c) d x e a sum of vectors.
        u = self.vectors
        if sum(degree) % 2:
            for i in range(self.count):
                yield (i,), u[i], _less(degree, i)
        else:
            for i, j in itertools.combinations(range(self.count), 2):
                if min(rest := _less(degree, i, j)) >= 0:
                    yield (i, j), cross_elements(u[i], u[j]), rest

    def _symmetrics(self, degree: _Degree) -> Iterator[tuple[Covariant, list[Any], _Degree]]:
        # Products with the first vector come first, so that they are preferred where several sums are equal.
        # What a degree has no room for needs no product.
        u = self.vectors
        for i in range(self.count):
            if sum(degree) % 2:
                for j, k in itertools.combinations(range(self.count), 2):
                    if min(rest := _less(degree, i, j, k)) >= 0:
                        yield (i, j, k), _symmetrize(u[i], cross_elements(u[j], u[k])), rest
            else:
                for j in range(i, self.count):
                    if min(rest := _less(degree, i, j)) >= 0:
                        yield (i, j), _symmetrize(u[i], u[j]), rest
        yield (), [self.ring(number) for number in _UNIT], degree

    def _solve(self, elements: list[Any], ansatz: _Ansatz) -> Coefficients:
        solved: Coefficients = {}
        for degree, target in self._by_degree(elements).items():
            labels, known = self._products(ansatz, degree)
            rows = {place: {**row} for place, row in known.items()}
            for place, coefficient in target.items():
                rows.setdefault(place, {})[len(labels)] = coefficient
            system = dict(enumerate(rows.values()))
            reduced, pivots = DomainMatrix(system, (len(rows), len(labels) + 1), sp.QQ).rref()
            if len(labels) in pivots:
                raise NotCovariantError(f"no covariant form in degree {degree}")
            solution = reduced.to_dod()
            for row, pivot in enumerate(pivots):
                coefficient = solution.get(row, {}).get(len(labels), 0)
                if coefficient:
                    covariant, monomial = labels[pivot]
                    value = Fraction(int(coefficient.numerator), int(coefficient.denominator))
                    solved.setdefault(covariant, {})[monomial] = value
        return solved

    def _products(self, ansatz: _Ansatz, degree: _Degree) -> _Products:
        """Return all products of a degree, and what each adds to every monomial of every element."""
        if (ansatz.__name__, degree) not in self._known:
            labels: list[tuple[Covariant, Monomial]] = []
            rows: dict[Any, dict[int, Any]] = {}
            for covariant, parts, rest in ansatz(degree):
                for monomial in invariants(rest, triple=not covariant):
                    value = self._value(monomial)
                    for k, part in enumerate(parts):
                        for place, coefficient in (part * value).terms():
                            rows.setdefault((k, place), {})[len(labels)] = coefficient
                    labels.append((covariant, monomial))
            self._known[ansatz.__name__, degree] = labels, rows
        return self._known[ansatz.__name__, degree]

    def _by_degree(self, elements: list[Any]) -> dict[_Degree, dict[Any, Any]]:
        parts: dict[_Degree, dict[Any, Any]] = {}
        for k, element in enumerate(elements):
            for place, coefficient in self.ring(element).terms():
                degree = [0] * self.count
                for owner, power in zip(self._owner, place, strict=True):
                    degree[owner] += power
                parts.setdefault(tuple(degree), {})[k, place] = coefficient
        return parts

    def _value(self, monomial: Monomial) -> Any:
        if monomial not in self._values:
            i, j, *k = monomial[0]
            other = cross_elements(self.vectors[j], self.vectors[k[0]]) if k else self.vectors[j]
            self._values[monomial] = dot(self.vectors[i], other) * self._value(monomial[1:])
        return self._values[monomial]


@cache
def invariants(degree: _Degree, triple: bool = False) -> tuple[Monomial, ...]:
    """Return all products of scalar products in which vector k occurs degree[k] times, with at most one triple product.

    One triple product is enough: two are a sum of products of scalar products. A negative degree has no products.
    """
    if min(degree) < 0:
        return ()
    if not any(degree):
        return ((),)
    first = next(k for k, n in enumerate(degree) if n)
    products = {
        tuple(sorted(((first, j), *rest)))
        for j in range(first, len(degree))
        for rest in invariants(_less(degree, first, j))
    }
    if triple and sum(degree) % 2:
        for three in itertools.combinations(range(len(degree)), 3):
            products |= {(three, *rest) for rest in invariants(_less(degree, *three))}
    return tuple(sorted(products))


def _less(degree: _Degree, *vectors: int) -> _Degree:
    rest = list(degree)
    for k in vectors:
        rest[k] -= 1
    return tuple(rest)


def _symmetrize(a: list[Any], b: list[Any]) -> list[Any]:
    return [a[i] * b[j] + a[j] * b[i] for i in range(3) for j in range(i, 3)]


def transform(decomposition: Decomposition, matrix: list[list[Fraction]]) -> Decomposition:
    """Return a decomposition in new vectors; row i of the matrix has the components of the old vector i."""
    expansions = {(i,): {(j,): c for j, c in enumerate(row) if c} for i, row in enumerate(matrix)}

    def expand(covariant: Covariant, canonical: Callable[[Covariant], tuple[Covariant, int]]) -> Polynomial:
        """Return a product of old vectors as a sum of products of new ones."""
        total: Polynomial = {}
        for choice in itertools.product(*(expansions[i,].items() for i in covariant)):
            product, sign = canonical(tuple([j for (j,), _ in choice]))
            if sign:
                coefficient = math.prod(
                    [factor for _, factor in choice[1:]], start=choice[0][1] if choice else ONE[()]
                )
                total = add(total, {(product,): coefficient if sign > 0 else -coefficient})
        return total

    products: dict[Covariant, Polynomial] = {}

    def product_of(factor: Covariant) -> Polynomial:
        if factor not in products:
            products[factor] = expand(factor, _sorted_product)
        return products[factor]

    def coefficients(
        old: Coefficients, canonical: Callable[[Covariant], tuple[Covariant, int]]
    ) -> Coefficients:
        transformed: Coefficients = {}
        for covariant, polynomial in old.items():
            moved = substitute(polynomial, product_of)
            for (new,), factor in expand(covariant, canonical).items():
                total = add(transformed.get(new, {}), moved, factor)
                if total:
                    transformed[new] = total
                else:
                    transformed.pop(new, None)
        return transformed

    return Decomposition(
        None if decomposition.scalar is None else substitute(decomposition.scalar, product_of),
        coefficients(decomposition.vector, _sorted_cross),
        coefficients(decomposition.symmetric, _sorted_symmetric),
    )


def _sorted_product(indices: Covariant) -> tuple[Covariant, int]:
    """Return the indices of a scalar or triple product in order, and the sign of the exchange."""
    if len(indices) < 3:
        return tuple(sorted(indices)), 1
    if len(set(indices)) < 3:
        return indices, 0
    exchanges = sum(a > b for a, b in itertools.combinations(indices, 2))
    return tuple(sorted(indices)), -1 if exchanges % 2 else 1


def _sorted_cross(indices: Covariant) -> tuple[Covariant, int]:
    if len(indices) < 2:
        return indices, 1
    i, j = indices
    return (min(i, j), max(i, j)), (i < j) - (i > j)


def _sorted_symmetric(indices: Covariant) -> tuple[Covariant, int]:
    if len(indices) < 3:
        return tuple(sorted(indices)), 1
    crossed, sign = _sorted_cross(indices[1:])
    return (indices[0], *crossed), sign
