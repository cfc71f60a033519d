"""`choose_products` rewrites polynomials in the scalar products in which they are shortest."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

from strapgen.kernel.polynomials import Polynomial, atom, atoms, substitute
from strapgen.lowering.canonical.vectors import Form, components

#: The weight of a scalar product in the cost, in factors of a term.
_PRODUCT = 3


def choose_products(
    polynomials: Sequence[Polynomial], basis: Sequence[tuple[str, Form]], offered: dict[str, Form]
) -> list[Polynomial]:
    """Rewrite polynomials in products (i, j) and (i, j, k) of a basis in the scalar products that make them shortest.

    One product after another is exchanged for another product of the vectors on offer, those of the basis and others in
    its span, as long as that saves operations. The result is in products of names, (name, name) and (name, name, name).
    """
    names = [name for name, _ in basis]
    current = [substitute(p, lambda factor: atom(tuple(names[k] for k in factor))) for p in polynomials]
    # Every product on offer is written in products of the basis; each exchange rewrites these expansions too.
    expansions: dict[tuple[str, ...], Polynomial] = {}
    along = {name: components(form, [form for _, form in basis]) for name, form in offered.items()}
    for a, b in itertools.combinations_with_replacement(offered, 2):
        total: dict[tuple[str, ...], Fraction] = {}
        for (i, x), (j, y) in itertools.product(enumerate(along[a]), enumerate(along[b])):
            if x and y:
                key = tuple(names[k] for k in sorted((i, j)))
                total[key] = total.get(key, Fraction(0)) + x * y
        expansions[a, b] = {(key,): value for key, value in total.items() if value}
    cost = _cost(current)
    while True:
        best = None
        used = {name for name in atoms(current) if len(name) == 2}
        for new, expansion in expansions.items():
            if new in used:
                continue
            for (old,), coefficient in expansion.items():
                if old not in used or {(old,)} == expansion.keys():
                    continue
                value = {m: -c / coefficient for m, c in expansion.items() if m != (old,)}
                value[new,] = 1 / coefficient
                tried = [_exchange(p, old, value) for p in current]
                if (reduced := _cost(tried)) < cost:
                    cost, best = reduced, (new, old, value, tried)
        if best is None:
            return current
        new, old, value, current = best
        expansions = {key: _exchange(p, old, value) for key, p in expansions.items()}


def _exchange(p: Polynomial, old: tuple[str, ...], value: Polynomial) -> Polynomial:
    if not any(old in monomial for monomial in p):
        return p
    return substitute(p, lambda name: value if name == old else atom(name))


def _cost(polynomials: Sequence[Polynomial]) -> int:
    distinct = {frozenset(p.items()): p for p in polynomials}.values()
    terms = sum(len(monomial) for p in distinct for monomial in p)
    return terms + _PRODUCT * len(atoms(polynomials))
