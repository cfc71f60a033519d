"""Series with bounds of their errors: truncated ones in bounded variables, and those of sine, cosine and arctangent.

Coefficients of truncated series are integers in units of 2^-192; the bound includes what their rounding loses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

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
        return self._combine(one, other, 1)

    def less(self, one: Series, other: Series) -> Series:
        """Return a difference."""
        return self._combine(one, other, -1)

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

    def _combine(self, one: Series, other: Series, sign: int) -> Series:
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


#: Bits of `pi`, and a bound of its error.
_PI_BITS = 256
PI_ERROR = Fraction(1, 1 << (_PI_BITS - 8))
#: Parameter p of the arctangent's series, which holds up to 2p/(1 - p^2) = 0.4394.
_ARCTANGENT = Fraction(21, 100)


@cache
def pi() -> Fraction:
    """Return a rational number below pi, by less than 2**-248.

    >>> float(pi())
    3.141592653589793
    """

    def arctangent_of_inverse(whole: int) -> Fraction:
        total, k = Fraction(0), 0
        while whole ** (2 * k + 1) < 1 << (_PI_BITS + 8):
            total += Fraction((-1) ** k, (2 * k + 1) * whole ** (2 * k + 1))
            k += 1
        return total

    # Machin's formula. The series alternate, so that either is off by less than its first term that is missing.
    value = 16 * arctangent_of_inverse(5) - 4 * arctangent_of_inverse(239) - Fraction(1, 1 << (_PI_BITS + 2))
    return Fraction(math.floor(value * (1 << _PI_BITS)), 1 << _PI_BITS)


def sine_series(first: int, reach: Fraction, tolerance: Fraction) -> tuple[tuple[Fraction, ...], Fraction]:
    """Return a truncated series of the sine or the cosine in the square of its argument, and a bound of its error.

    It begins with degree `first`, 0 for the cosine and 1 for the sine; `reach` bounds the argument, and is at most 2.

    >>> sine_series(1, Fraction(1), Fraction(1, 5040))
    ((Fraction(1, 1), Fraction(-1, 6), Fraction(1, 120)), Fraction(1, 5040))
    """
    # The terms alternate and fall from the third on: what is left out is less than its first term.
    degree = first
    coefficients: list[Fraction] = []
    while len(coefficients) < 3 or reach**degree > tolerance * math.factorial(degree):
        coefficients.append(Fraction((-1) ** (degree // 2), math.factorial(degree)))
        degree += 2
    return tuple(coefficients), reach**degree / math.factorial(degree)


def binomial_series(
    exponent: Fraction, reach: Fraction, tolerance: Fraction
) -> tuple[tuple[Fraction, ...], Fraction]:
    """Return a truncated series of (1 + u)^exponent in u, and a bound of its error.

    The exponent is from -1 to 1, and `reach` bounds the magnitude of u, below 1.

    >>> binomial_series(Fraction(-1, 2), Fraction(1, 8), Fraction(1, 100))
    ((Fraction(1, 1), Fraction(-1, 2)), Fraction(3, 448))
    """
    # Coefficients do not grow in magnitude: what is left out is less than a geometric series.
    coefficients = [Fraction(1)]
    while True:
        degree = len(coefficients)
        following = coefficients[-1] * (exponent - degree + 1) / degree
        left_out = abs(following) * reach**degree / (1 - reach)
        if left_out <= tolerance:
            return tuple(coefficients), left_out
        coefficients.append(following)


@cache
def arctangent_series(tolerance: Fraction) -> tuple[tuple[Fraction, ...], Fraction]:
    """Return a polynomial in u^2 that is arctan(u)/u, and a bound of the error of their product with u.

    With u = (2p/(1 - p^2)) x, arctan(u) is the sum of 2 (-1)^k p^(2k+1)/(2k+1) T_(2k+1)(x), T Chebyshev's polynomials,
    none of which exceeds 1 for x from -1 to 1.
    """
    p = _ARCTANGENT
    scale = (1 - p * p) / (2 * p)
    total: list[Fraction] = []
    older, newer = [Fraction(1)], [Fraction(0), Fraction(1)]  # Chebyshev's polynomials 0 and 1, by powers
    number = 1
    while True:
        factor = 2 * (-1) ** (number // 2) * p**number / number
        total = [
            (total[k] if k < len(total) else Fraction(0)) + factor * newer[2 * k + 1]
            for k in range(number // 2 + 1)
        ]
        number += 2
        left_out = 2 * p**number / (number * (1 - p * p))
        if len(total) > 2 and left_out <= tolerance:
            break
        for _ in range(2):
            older, newer = newer, _next_chebyshev(older, newer)
    return tuple(c * scale ** (2 * k + 1) for k, c in enumerate(total)), left_out


def _next_chebyshev(older: list[Fraction], newer: list[Fraction]) -> list[Fraction]:
    """Return the polynomial after two of Chebyshev's polynomials."""
    doubled = [Fraction(0), *(2 * c for c in newer)]
    return [c - (older[k] if k < len(older) else 0) for k, c in enumerate(doubled)]
