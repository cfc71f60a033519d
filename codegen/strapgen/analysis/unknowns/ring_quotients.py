"""Substitution of quotients for unknowns in elements of a ring of SymPy."""

from __future__ import annotations

from operator import le
from typing import Any


def linear_coefficient(polynomial: Any, place: int) -> Any:
    """Return the coefficient of an unknown in which a polynomial is linear; None if it is not."""
    terms = {}
    for exponents, number in polynomial.terms():
        if exponents[place] > 1:
            return None
        if exponents[place]:
            terms[(*exponents[:place], 0, *exponents[place + 1 :])] = number
    return polynomial.ring.from_dict(terms) if terms else None


def without(polynomial: Any, place: int, coefficient: Any) -> Any:
    """Return a polynomial minus its term in an unknown, in which it is linear."""
    return polynomial - coefficient * polynomial.ring.gens[place]


def substituted(polynomial: Any, place: int, top: Any, bottom: Any) -> Any:
    """Return the numerator of a polynomial after the substitution of top/bottom for an unknown."""
    parts: dict[int, dict[Any, Any]] = {}
    for exponents, number in polynomial.terms():
        parts.setdefault(exponents[place], {})[(*exponents[:place], 0, *exponents[place + 1 :])] = number
    degree = max(parts, default=0)
    if not degree:
        return polynomial
    total = polynomial.ring.zero
    for power, terms in parts.items():
        part = polynomial.ring.from_dict(terms)
        if power:  # zero to the power 0 is an error in a ring
            part = part * top**power
        total += part * bottom ** (degree - power)
    return total


def quotient_of(above: Any, below: Any, place: int, top: Any, bottom: Any) -> tuple[Any, Any]:
    """Return above/below after the substitution of top/bottom for an unknown."""
    degrees = max(above.degree(place), 0), max(below.degree(place), 0)
    x, y = (substituted(p, place, top, bottom) for p in (above, below))
    return x * bottom ** max(degrees[1] - degrees[0], 0), y * bottom ** max(degrees[0] - degrees[1], 0)


def cancelled(top: Any, bottom: Any) -> tuple[Any, Any]:
    """Return a quotient in lowest terms."""
    common = top.gcd(bottom)
    return top.exquo(common), bottom.exquo(common)


def may_divide(divisor: Any, polynomial: Any) -> bool:
    """Return whether the leading and the last monomial of a divisor divide those of a polynomial, as they must.

    Both are of a ring in lexical order; a division that cannot be without a rest need not be tried.
    """
    return all(
        all(map(le, one, other))
        for one, other in ((divisor.LM, polynomial.LM), (min(divisor), min(polynomial)))
    )
