"""Truncated series are polynomials of bounded variables up to a degree, with a bound of all terms left out.

Coefficients are integers in units of 2^-192; the bound includes what their rounding loses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

#: Binary places of a coefficient, so many that its rounding does not count beside the terms left out.
_PLACES = 192
_UNIT = Fraction(1, 1 << _PLACES)

#: Places of the variables in a product, in order.
Monomial = tuple[int, ...]


@dataclass(frozen=True)
class Series:
    """A polynomial, and a bound of its distance from the function that it approximates."""

    terms: dict[int, dict[Monomial, int]]  # coefficients by degree and product
    rest: Fraction  # bound of the distance


class Truncated:
    """Arithmetic of series in variables of at most these magnitudes, truncated to at most `most` terms."""

    def __init__(self, sizes: Sequence[Fraction], most: int) -> None:
        self.sizes = list(sizes)
        self.degree = 1
        while math.comb(len(sizes) + self.degree + 1, self.degree + 1) <= most:
            self.degree += 1
        #: The largest magnitudes over one denominator, and the numerators of their products.
        self._denominator = math.lcm(*(size.denominator for size in self.sizes))
        self._numerators = [int(size * self._denominator) for size in self.sizes]
        self._products: dict[Monomial, int] = {}
        #: Largest magnitude of a product of variables that is kept.
        self._largest = max([Fraction(1), *self.sizes]) ** self.degree

    def constant(self, value: Fraction) -> Series:
        """Return a constant."""
        scaled = round(value / _UNIT)
        return Series({0: {(): scaled}} if scaled else {}, abs(value - scaled * _UNIT))

    def variable(self, place: int) -> Series:
        """Return a variable."""
        return Series({1: {(place,): 1 << _PLACES}}, Fraction(0))

    def size(self, series: Series) -> Fraction:
        """Return a bound of the magnitude of the function that a series approximates."""
        return series.rest + sum((self._size(part) for part in series.terms.values()), Fraction(0))

    def sum(self, one: Series, other: Series) -> Series:
        """Return a sum."""
        return self._combined(one, other, 1)

    def less(self, one: Series, other: Series) -> Series:
        """Return a difference."""
        return self._combined(one, other, -1)

    def product(self, one: Series, other: Series) -> Series:
        """Return a product."""
        terms: dict[int, dict[Monomial, int]] = {}
        size, others = self.size(one), self.size(other)
        rest = one.rest * others + (size - one.rest) * other.rest
        rounded = 0
        for a, first in one.terms.items():
            for b, second in other.terms.items():
                if a + b > self.degree:
                    rest += self._size(first) * self._size(second)
                    continue
                into = terms.setdefault(a + b, {})
                for left, x in first.items():
                    for right, y in second.items():
                        key = tuple(sorted(left + right))
                        into[key] = into.get(key, 0) + x * y
        for part in terms.values():
            for key, coefficient in part.items():
                part[key] = coefficient >> _PLACES
                rounded += 1
        return Series(_without_zeros(terms), rest + rounded * _UNIT * self._largest)

    def dot(self, one: Sequence[Series], other: Sequence[Series]) -> Series:
        """Return the sum of the products of the elements of two vectors."""
        total = self.constant(Fraction(0))
        for left, right in zip(one, other, strict=True):
            total = self.sum(total, self.product(left, right))
        return total

    def _combined(self, one: Series, other: Series, sign: int) -> Series:
        """Return a series plus or minus another."""
        terms = {degree: dict(part) for degree, part in one.terms.items()}
        for degree, part in other.terms.items():
            into = terms.setdefault(degree, {})
            for key, coefficient in part.items():
                into[key] = into.get(key, 0) + sign * coefficient
        return Series(_without_zeros(terms), one.rest + other.rest)

    def _size(self, part: dict[Monomial, int]) -> Fraction:
        """Return a bound of the magnitude of terms of one degree."""
        products, total, degree = self._products, 0, 0
        for key, coefficient in part.items():
            if key not in products:
                products[key] = math.prod(self._numerators[place] for place in key)
            total += abs(coefficient) * products[key]
            degree = len(key)
        return Fraction(total, self._denominator**degree << _PLACES)


def _without_zeros(terms: dict[int, dict[Monomial, int]]) -> dict[int, dict[Monomial, int]]:
    """Drop the terms that have cancelled."""
    nonzero = {degree: {key: c for key, c in part.items() if c} for degree, part in terms.items()}
    return {degree: part for degree, part in nonzero.items() if part}
