"""Polynomials in the oscillations of lines, of which only what leads to a mean rate is kept.

Line i is a pair of oscillations exp(j omega t) and exp(-j omega t) with the numbers 2 i and 2 i + 1. A product of up to
four of them has a mean if its frequencies add up to zero or, for an algorithm that sees it once a step, to whole
periods in a step: it is a resonance. Products that divide no resonance lead to none, and are dropped.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

#: Highest degree in the amplitudes of the lines.
DEGREE = 4
#: The numbers of oscillations in a product, in order.
Product = tuple[int, ...]
Array = NDArray[np.complex128]


def resonances(shares: Sequence[Fraction]) -> list[Product]:
    """Return the products of up to four oscillations that have a mean.

    One line, and a second one of twice its frequency:

    >>> len(resonances([Fraction(1, 10)]))
    2
    >>> [product for product in resonances([Fraction(1, 10), Fraction(1, 5)]) if len(product) == 3]
    [(0, 0, 3), (1, 1, 2)]
    """
    whole = math.lcm(*(share.denominator for share in shares))
    parts = [sign * int(share * whole) % whole for share in shares for sign in (1, -1)]
    by_sum: list[dict[int, list[Product]]] = [defaultdict(list) for _ in range(3)]
    by_sum[0][0].append(())
    for size in (1, 2):
        for product in itertools.combinations_with_replacement(range(len(parts)), size):
            by_sum[size][sum(parts[k] for k in product) % whole].append(product)
    found: set[Product] = set()
    for left, right in ((0, 1), (0, 2), (1, 2), (2, 2)):
        for rest, products in by_sum[left].items():
            others = by_sum[right].get(-rest % whole, [])
            found |= {tuple(sorted(one + other)) for one in products for other in others}
    return sorted(found, key=lambda product: (len(product), product))


class Oscillations:
    """The ring of polynomials in the oscillations of lines, up to what divides no resonance.

    It takes the place of a ring of SymPy as that of the coefficients of `power_series.Powers`.
    """

    #: The numbers of the kernels, in double.
    domain = sp.RR

    def __init__(self, shares: Sequence[Fraction]) -> None:
        self.resonant = resonances(shares)
        kept: list[set[Product]] = [{()}, *(set() for _ in range(DEGREE))]
        for product in self.resonant:
            for degree in range(1, len(product) + 1):
                kept[degree].update(itertools.combinations(product, degree))
        self.products = [sorted(one) for one in kept]
        self.places = [{product: k for k, product in enumerate(one)} for one in self.products]
        self._tables = {(a, b): self._table(a, b) for a in range(DEGREE + 1) for b in range(DEGREE + 1 - a)}
        self.zero = self(0)

    def __call__(self, number: Any) -> Polynomial:
        """Return a number as a polynomial; a polynomial itself."""
        if isinstance(number, Polynomial):
            return number
        return Polynomial(self, 0, np.array([complex(number)]))

    def oscillating(self, amplitudes: Iterable[complex]) -> Polynomial:
        """Return Re(sum_i c_i exp(j omega_i t)) for the complex amplitudes c_i of all lines."""
        values = [half for c in amplitudes for half in (c / 2, complex(c).conjugate() / 2)]
        return Polynomial(self, 1, np.array([values[k] for (k,) in self.products[1]]))

    def _table(self, a: int, b: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Return the places of all pairs of factors of all products of a degree, and where each product begins."""
        left: list[int] = []
        right: list[int] = []
        begins: list[int] = []
        for product in self.products[a + b]:
            begins.append(len(left))
            splits = {
                (
                    tuple(product[k] for k in chosen),
                    tuple(product[k] for k in range(a + b) if k not in chosen),
                )
                for chosen in itertools.combinations(range(a + b), a)
            }
            for one, other in splits:
                left.append(self.places[a][one])
                right.append(self.places[b][other])
        return np.array(left, np.intp), np.array(right, np.intp), np.array(begins, np.intp)

    def product(self, a: int, x: Array, b: int, y: Array, form: str = "n,n->n") -> Array:
        """Return the coefficients of a product of homogeneous polynomials, or of matrices of them.

        `x, y` (..., number of products): coefficients by the products of each degree.
        """
        left, right, begins = self._tables[a, b]
        terms = np.einsum(form, x[..., left], y[..., right])
        return np.asarray(np.add.reduceat(terms, begins, axis=-1), complex)


class Polynomial:
    """A homogeneous polynomial in the oscillations of lines.

    `values` (number of products): coefficients by the products of this degree.
    """

    __slots__ = ("degree", "ring", "values")

    def __init__(self, ring: Oscillations, degree: int, values: Array) -> None:
        self.ring, self.degree, self.values = ring, degree, values

    def __bool__(self) -> bool:
        return bool(self.values.any())

    @property
    def is_ground(self) -> bool:
        """Whether it is a number, as of a polynomial of SymPy."""
        return self.degree == 0

    @property
    def LC(self) -> Any:
        """The number that it is."""
        return self.ring.domain(self.values[0].real)

    def __add__(self, other: Polynomial) -> Polynomial:
        return Polynomial(self.ring, self.degree, self.values + other.values)

    def __neg__(self) -> Polynomial:
        return Polynomial(self.ring, self.degree, -self.values)

    def __mul__(self, other: Any) -> Polynomial:
        if not isinstance(other, Polynomial):
            return Polynomial(self.ring, self.degree, self.values * float(other))
        values = self.ring.product(self.degree, self.values, other.degree, other.values)
        return Polynomial(self.ring, self.degree + other.degree, values)
