"""Computes series of sine, cosine and arctangent, and a rational pi, with bounds of their errors."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

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
