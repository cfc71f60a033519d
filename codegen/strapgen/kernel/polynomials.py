"""Sparse polynomials with rational coefficients in any atoms that can be ordered.

A polynomial is a dictionary from monomials to coefficients, and a monomial is the sorted tuple of its atoms, repeated
by their powers. SymPy's rings would not do for the search for the cheapest form, which tries hundreds of small
substitutions: a ring must know its generators beforehand and takes longer to set up than a substitution takes here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any

Monomial = tuple[Any, ...]
Polynomial = dict[Monomial, Fraction]

ONE: Polynomial = {(): Fraction(1)}


def atom(name: Any) -> Polynomial:
    """Return an atom as a polynomial."""
    return {(name,): Fraction(1)}


def add(p: Polynomial, q: Polynomial, factor: Fraction | int = 1) -> Polynomial:
    """Return p + factor q."""
    total = dict(p)
    for monomial, coefficient in q.items():
        _gather(total, monomial, coefficient if factor == 1 else factor * coefficient)
    return total


def _gather(total: Polynomial, monomial: Monomial, coefficient: Fraction) -> None:
    """Add a term to a polynomial in place."""
    if monomial in total:
        coefficient = total[monomial] + coefficient
    if coefficient:
        total[monomial] = coefficient
    else:
        total.pop(monomial, None)


def scale(p: Polynomial, factor: Fraction | int) -> Polynomial:
    """Return factor p."""
    return {monomial: factor * coefficient for monomial, coefficient in p.items()} if factor else {}


def multiply(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return p q."""
    total: Polynomial = {}
    for first, a in p.items():
        for second, b in q.items():
            monomial = tuple(sorted(first + second)) if first and second else first or second
            _gather(total, monomial, a * b)
    return total


#: The operations of programs that polynomials have, by kind.
OPERATIONS: dict[str, Callable[..., Polynomial]] = {
    "add": add,
    "subtract": lambda p, q: add(p, q, -1),
    "negate": lambda p: scale(p, -1),
    "multiply": multiply,
}


def substitute(p: Polynomial, value: Callable[[Any], Polynomial]) -> Polynomial:
    """Return p with every atom replaced by a polynomial."""
    total: Polynomial = {}
    for monomial, coefficient in p.items():
        product = {(): coefficient}
        for name in monomial:
            product = multiply(product, value(name))
        total = add(total, product)
    return total


def atoms(polynomials: Iterable[Polynomial]) -> set[Any]:
    """Return all atoms that occur in some polynomials."""
    return {name for p in polynomials for monomial in p for name in monomial}


def ratio(p: Polynomial, q: Polynomial) -> Fraction | None:
    """Return the number c with p = c q, None if there is none."""
    if not p or p.keys() != q.keys():
        return None
    monomial = next(iter(p))
    c = p[monomial] / q[monomial]
    return c if all(coefficient == c * q[m] for m, coefficient in p.items()) else None
