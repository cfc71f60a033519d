"""Searches for the basis in which a transition takes the fewest operations."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction

from strapgen.kernel.covariants import Decomposition, transform
from strapgen.kernel.polynomials import Polynomial, atoms
from strapgen.lowering.canonical.core import Core
from strapgen.lowering.canonical.plan import Cross, Opened, Plan, Sides, without_triples
from strapgen.lowering.canonical.vectors import (
    Form,
    Pool,
    all_components,
    independent,
    mirrored,
    normalized,
    proportion,
)
from strapgen.lowering.canonical.writing import unsigned

#: How many bases, those with the lowest first guess, are planned in every way.
_PLANNED = 30
#: Most products of vectors that are expanded in order to compare bases.
_EXPANSIONS = 300_000
#: Most terms of a decomposition that can still be shorter than the stages.
_MOST_TERMS = 500


def plans(core: Core, decomposition: Decomposition) -> list[Plan]:
    """Return plans for a transition, the lowest estimate first; none if so many terms make its stages cheaper."""
    base = core.base()
    count = len(base)
    terms = [monomial for p in decomposition.coefficients() for monomial in p]
    if len(terms) > _MOST_TERMS:
        return []
    expansions = sum(count ** sum(map(len, monomial)) for monomial in terms)
    forms, names = _candidates(core)
    bases: list[tuple[int, tuple[Form, ...], Decomposition]] = []
    choices = (c for c in itertools.combinations(forms, count) if len(independent(c)) == count)
    for basis in itertools.islice(choices, 1 + _EXPANSIONS // expansions):
        moved = transform(decomposition, all_components(base, basis))
        bases.append((_outlook(moved) + 3 * sum(map(_terms, basis)), basis, moved))
    bases.sort(key=lambda entry: entry[0])
    ranked = [
        (_estimate(plan), plan)
        for _, basis, moved in bases[:_PLANNED]
        for plan in _plans(core, basis, moved, names)
    ]
    ranked.sort(key=lambda entry: entry[0])
    return [plan for _, plan in ranked]


def _candidates(core: Core) -> tuple[list[Form], dict[Form, tuple[str, str]]]:
    """Return vectors that may stand in a basis, and the name and meaning of those that have one."""
    span = core.base()
    count = len(core.inputs)
    names: dict[Form, tuple[str, str]] = {}
    forms: list[Form] = []

    def offer(form: Form, name: str = "", meaning: str = "") -> None:
        if not any(form) or len(independent([*span, form])) > len(span):
            return
        unit = normalized(form)
        if name and not any(proportion(unit, known) for known in names):
            names[form] = name, meaning
        if unit not in forms:
            forms.append(unit)

    for k, name in enumerate(core.inputs):
        offer(tuple(Fraction(int(j == k)) for j in range(count)), name)
    if core.whole is not None and sum(core.whole) > 1:
        offer(core.whole, "sigma", "the angle increment of the whole step")
    if count == 2 and core.whole and all(core.whole):
        offer((Fraction(1), Fraction(-1)), "delta", "first half minus second half")
    for name, (signal, form) in core.vectors.items():
        offer(form, name, signal.meaning)
    for a, b in itertools.combinations([form for _, form in core.vectors.values()], 2):
        for sign in (1, -1):
            offer(tuple(x + sign * y for x, y in zip(a, b, strict=True)))
    return forms, names


def _plans(
    core: Core, basis: tuple[Form, ...], decomposition: Decomposition, names: dict[Form, tuple[str, str]]
) -> Iterator[Plan]:
    both_ways = any(
        tuple(s * x for x in mirrored(a)) == b for a in basis for b in basis for s in (1, -1) if a != b
    )
    for halves in (False, True) if len(core.inputs) > 2 and both_ways else (False,):
        pool = Pool(core.inputs, names)
        if halves:
            for form in basis:
                if mirrored(form) in basis or tuple(-x for x in mirrored(form)) in basis:
                    pool.define_mirrored(form)
        named = [pool.define(form) for form in basis]
        lengths = [
            [factor if i == j else Fraction(0) for j in range(len(named))]
            for i, (_, factor) in enumerate(named)
        ]
        for variant in without_triples(decomposition):
            if any(factor != 1 for _, factor in named):
                variant = transform(variant, lengths)
            matrix = core.transition.shape == (3, 3)
            for weighted, opened in itertools.product((False, True), Opened if matrix else (Opened.NONE,)):
                plan = Plan(pool.copy(), [name for name, _ in named], weighted, opened)
                if matrix:
                    plan.matrix(variant)
                else:
                    plan.quaternion(variant, core.transition.elements[0].rsplit("_", 1)[0])
                yield plan


def _terms(form: Form) -> int:
    return sum(1 + (abs(x) != 1) for x in form if x) - 1


def _outlook(decomposition: Decomposition) -> int:
    """Return a first guess at the number of operations of a decomposition."""
    polynomials = decomposition.coefficients()
    vectors = len(decomposition.vector) + len(decomposition.symmetric)
    axes = {c[0] for c in decomposition.symmetric if c}
    distinct = {unsigned(p): p for p in polynomials}.values()
    monomials = sum(len(m) for p in distinct for m in p)
    return 6 * vectors + 6 * len(axes) + monomials + 4 * len(atoms(polynomials))


def _estimate(plan: Plan) -> int:
    """Return an estimate of the number of operations of a plan."""
    total = sum({Sides.BOTH: 21, Sides.PARALLEL: 12}.get(outer.sides, 15) for outer in plan.outers)
    weights: dict[object, Polynomial] = {}
    needed: list[str] = []
    for definition in plan.definitions:
        if isinstance(definition, Cross):
            total += 9
            needed += [definition.left, definition.right]
            continue
        for polynomial, vector in definition.terms:
            needed.append(vector)
            if polynomial.keys() != {()}:
                weights[unsigned(polynomial)] = polynomial
                total += 3
            elif abs(polynomial[()]) != 1:
                total += 3
        total += 3 * (len(definition.terms) - 1)
    polynomials = [*weights.values(), *(p for p, _ in plan.scalars.values())]
    total += sum(len(monomial) + 1 for p in polynomials for monomial in p if monomial)
    products = atoms(polynomials)
    needed += [plan.basis[k] for factor in products for k in factor]
    return total + 4 * len(products) + plan.pool.operations(needed)
