"""Plans list the vectors to compute for a transition in a basis; the search finds the basis with fewest operations."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

from strapgen.kernel.covariants import Coefficients, Covariant, Decomposition, transform
from strapgen.kernel.polynomials import ONE, Polynomial, add, atoms, ratio, scale
from strapgen.lowering.canonical.core import Core
from strapgen.lowering.canonical.vectors import (
    Form,
    Pool,
    all_components,
    independent,
    mirrored,
    normalized,
    proportion,
)


@dataclass(frozen=True)
class Cross:
    """A cross product of two named vectors."""

    name: str
    left: str
    right: str


@dataclass(frozen=True)
class Weighted:
    """A sum of named vectors, each with a polynomial in products of the basis as its weight."""

    name: str
    terms: tuple[tuple[Polynomial, str], ...]
    meaning: str


class OpenedProducts(Enum):
    """The cross products in the skew part that go into outer products; u z' - z u' is the skew matrix of z x u."""

    NONE = "none"
    PLAIN = "those of two vectors"
    RIGHT = "with them those of three vectors, so that the right partner gets them"
    LEFT = "the same for the left partner"


class Sides(Enum):
    """The outer products that a matrix has of a vector u of the basis and its partner y."""

    BOTH = "u y' + y u'"
    PARALLEL = "u y', y along u"
    RIGHT = "u y'"
    LEFT = "y u'"


@dataclass(frozen=True)
class _Outer:
    """Outer products of a vector of the basis and its partner, as one part of a matrix."""

    vector: str
    partner: str
    sides: Sides


@dataclass
class Plan:
    """The vectors, weights and outer products from which a transition is computed."""

    pool: Pool  # vectors that are linear in the inputs
    basis: list[str]  # names of the vectors to which the products in the weights refer
    #: Before a cross product, weights save cross products with a common factor; after it, sums can share them.
    weighted_first: bool
    opened: OpenedProducts = OpenedProducts.NONE
    definitions: list[Cross | Weighted] = field(default_factory=list)  # in the order of computation
    #: The scalar part of a quaternion or the diagonal of a matrix, with its meaning.
    scalars: dict[str, tuple[Polynomial, str]] = field(default_factory=dict)
    outers: list[_Outer] = field(default_factory=list)  # those of a matrix
    _degrees: Counter[int] = field(default_factory=Counter)

    def polynomials(self) -> list[Polynomial]:
        """Return all weights and scalars."""
        weights = [p for d in self.definitions if isinstance(d, Weighted) for p, _ in d.terms]
        return [*weights, *(p for p, _ in self.scalars.values())]

    def forms(self) -> list[Form]:
        """Return the forms of the basis."""
        return [self.pool.vectors[name].form for name in self.basis]

    def quaternion(self, decomposition: Decomposition, name: str) -> None:
        """Plan the vector part of a quaternion, under the name of the quaternion, and its scalar part."""
        self._count_edges([decomposition.vector])
        self.scalars["scalar"] = (decomposition.scalar or {}, "its scalar part")
        self._sum(name, decomposition.vector, "the step applied to the identity: its vector part")

    def matrix(self, decomposition: Decomposition) -> None:
        """Plan the vector of the skew part of a matrix, and outer products of vectors and their partners."""
        symmetric, skew = decomposition.symmetric, dict(decomposition.vector)
        names = self.basis
        chosen = _axes(symmetric)
        partners: dict[int, Coefficients] = {i: {} for i in chosen}
        for covariant, coefficient in symmetric.items():
            if not covariant:
                continue
            i = next(k for k in chosen if k in covariant[: 1 if len(covariant) == 3 else 2])
            rest = list(covariant)
            rest.remove(i)
            partners[i][tuple(rest)] = coefficient
        levers: dict[int, Coefficients] = {i: {} for i in chosen}
        if self.opened is not OpenedProducts.NONE:
            for i, partner in partners.items():
                levers[i] = _take_lever(skew, i)
                if self.opened is not OpenedProducts.PLAIN:
                    levers[i] |= _take_triple(
                        skew, i, partner, 1 if self.opened is OpenedProducts.RIGHT else -1
                    )
        self._count_edges([skew, *partners.values()])
        self.scalars["diagonal"] = (symmetric.get((), {}), "multiple of the unit matrix")
        if skew:
            self._sum("skew", skew, "vector of the skew part")
        for i, partner in partners.items():
            suffix = f"_{names[i]}" if len(partners) > 1 else ""
            self._outer(names[i], f"partner{suffix}", partner, levers[i], alone=set(partner) == {(i,)})

    def _outer(self, vector: str, name: str, partner: Coefficients, lever: Coefficients, alone: bool) -> None:
        """Plan u y' + y u' and, for a lever z, u z' - z u'."""
        if not lever:
            if alone:
                partner = {c: scale(p, 2) for c, p in partner.items()}
            self._sum(name, partner, f"of {vector} in outer products")
            self.outers.append(_Outer(vector, name, Sides.PARALLEL if alone else Sides.BOTH))
            return
        common = {c: p for c, p in partner.items() if c not in lever}
        sides: list[Coefficients] = []
        for sign in (1, -1):
            side = {c: add(partner.get(c, {}), p, sign) for c, p in lever.items()}
            sides.append({c: p for c, p in side.items() if p})
        shared: list[tuple[Polynomial, str]] = []
        if common and all(sides) and len(common) > 1:
            self._sum(f"{name}_common", common, f"what both partners of {vector} have")
            shared, common = [(ONE, f"{name}_common")], {}
        for side, kind in zip(sides, (Sides.RIGHT, Sides.LEFT), strict=True):
            if side or shared or common:
                partner_name = f"{name}_{kind.name.lower()}"
                self._sum(
                    partner_name,
                    side | common,
                    f"{kind.name.lower()} of {vector} in an outer product",
                    shared,
                )
                self.outers.append(_Outer(vector, partner_name, kind))

    def _count_edges(self, vectors: Iterable[Coefficients]) -> None:
        for coefficients in vectors:
            self._degrees.update(i for covariant in coefficients if len(covariant) == 2 for i in covariant)

    def _sum(
        self,
        name: str,
        coefficients: Coefficients,
        meaning: str,
        shared: Iterable[tuple[Polynomial, str]] = (),
    ) -> None:
        straight = {c[0]: p for c, p in coefficients.items() if len(c) == 1}
        terms = [*shared, *self._group(straight)]
        levers: dict[int, dict[int, Polynomial]] = {}
        for covariant, polynomial in coefficients.items():
            if len(covariant) == 2:
                i, j = covariant
                if (self._degrees[i], -i) > (self._degrees[j], -j):
                    levers.setdefault(i, {})[j] = scale(polynomial, -1)
                else:
                    levers.setdefault(j, {})[i] = polynomial
        for centre, lever in levers.items():
            groups = self._group(lever)
            right = self.basis[centre]
            if len(groups) > 1 and self.weighted_first:
                left = f"{name}_lever" if len(levers) == 1 else f"{name}_lever_{right}"
                self._define(
                    Weighted(left, tuple(groups), f"its cross product with {right} goes into {name}")
                )
                groups = [(ONE, left)]
            terms += [(weight, self._cross(left, right)) for weight, left in groups]
        self._define(Weighted(name, tuple(terms), meaning))

    def _cross(self, left: str, right: str) -> str:
        name = f"{left}_cross_{right}"
        self._define(Cross(name, left, right))
        return name

    def _define(self, definition: Cross | Weighted) -> None:
        if definition not in self.definitions:
            self.definitions.append(definition)

    def _group(self, columns: dict[int, Polynomial]) -> list[tuple[Polynomial, str]]:
        """Return weights and vectors, with vectors of proportional weights summed first where that saves operations."""
        groups: list[tuple[Polynomial, list[tuple[Fraction, int]]]] = []
        for index, polynomial in columns.items():
            for first, members in groups:
                factor = ratio(polynomial, first)
                if factor is not None:
                    members.append((factor, index))
                    break
            else:
                groups.append((polynomial, [(Fraction(1), index)]))
        terms: list[tuple[Polynomial, str]] = []
        forms = self.forms()
        for polynomial, members in groups:
            if len(members) > 1:
                whole = tuple(
                    sum((c * forms[i][k] for c, i in members), Fraction(0)) for k in range(len(forms[0]))
                )
                known = self.pool.find(whole)
                if known is None and all(abs(c) == 1 for c, _ in members):
                    known = self.pool.define(whole)
                if known is not None:
                    terms.append((scale(polynomial, known[1]), known[0]))
                    continue
            terms += [(scale(polynomial, c), self.basis[i]) for c, i in members]
        return terms


def _take_lever(skew: Coefficients, axis: int) -> Coefficients:
    """Remove the cross products z x u with a vector u of the basis from a skew part and return z."""
    lever: Coefficients = {}
    for covariant in [c for c in skew if len(c) == 2 and axis in c]:
        i, j = covariant
        polynomial = skew.pop(covariant)
        lever[j if i == axis else i,] = scale(polynomial, -1) if i == axis else polynomial
    return lever


def _take_triple(skew: Coefficients, axis: int, partner: Coefficients, sign: int) -> Coefficients:
    """Remove (a x b) x u, for cross products a x b in a partner of u, from a skew part and return the a x b.

    (a x b) x u is (a . u) b - (b . u) a. The weights are those in the partner, or their negatives.
    """
    lever: Coefficients = {c: scale(p, sign) for c, p in partner.items() if len(c) == 2}
    for covariant, polynomial in lever.items():
        a, b = covariant
        for remaining, other, factor in ((b, a, -1), (a, b, 1)):
            product = {tuple(sorted((*m, tuple(sorted((other, axis)))))): c for m, c in polynomial.items()}
            total = add(skew.pop((remaining,), {}), product, factor)
            if total:
                skew[remaining,] = total
    return lever


def _axes(symmetric: Coefficients) -> list[int]:
    """Return vectors of the basis such that every symmetrized product has one of them as its first factor."""
    axes = {c[0] for c in symmetric if len(c) == 3 or (len(c) == 2 and c[0] == c[1])}
    open_pairs = [c for c in symmetric if len(c) == 2 and not axes & set(c)]
    while open_pairs:
        counts = Counter(i for c in open_pairs for i in c)
        axes.add(max(counts, key=lambda i: (counts[i], -i)))
        open_pairs = [c for c in open_pairs if not axes & set(c)]
    return sorted(axes)


def without_triples(decomposition: Decomposition) -> list[Decomposition]:
    """Return the forms with the fewest axes of a decomposition; an axis is a first factor of outer products.

    u1 (u2 x u3)' + u2 (u3 x u1)' + u3 (u1 x u2)', symmetrized, is twice the triple product times the unit
    matrix, so each of the three terms can be exchanged for the other two.
    """
    variants = [decomposition]
    for covariant, coefficient in decomposition.symmetric.items():
        if len(covariant) < 3 or len(set(covariant)) < 3:
            continue
        i, j, k = sorted(covariant)
        cycle: dict[Covariant, int] = {(i, j, k): 1, (j, i, k): -1, (k, i, j): 1}
        factor = -cycle[covariant]
        symmetric = dict(decomposition.symmetric)
        for other, sign in cycle.items():
            symmetric[other] = add(symmetric.get(other, {}), coefficient, factor * sign)
        triple = {tuple(sorted((*m, (i, j, k)))): c for m, c in coefficient.items()}
        symmetric[()] = add(symmetric.get((), {}), triple, -2 * factor)
        symmetric = {c: p for c, p in symmetric.items() if p}
        variants.append(Decomposition(None, decomposition.vector, symmetric))
    fewest = min(len(_axes(variant.symmetric)) for variant in variants)
    return [variant for variant in variants if len(_axes(variant.symmetric)) == fewest]


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
            for weighted, opened in itertools.product(
                (False, True), OpenedProducts if matrix else (OpenedProducts.NONE,)
            ):
                plan = Plan(pool.copy(), [name for name, _ in named], weighted, opened)
                if matrix:
                    plan.matrix(variant)
                else:
                    plan.quaternion(variant, core.transition.elements[0].rsplit("_", 1)[0])
                yield plan


def _terms(form: Form) -> int:
    return sum(1 + (abs(x) != 1) for x in form if x) - 1


def _outlook(decomposition: Decomposition) -> int:
    """Return a quick estimate of the number of operations of a decomposition."""
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


def unsigned(polynomial: Polynomial) -> frozenset[object]:
    """Return a key that is the same for a polynomial and its negative."""
    first = polynomial[min(polynomial)] if polynomial else Fraction(0)
    return frozenset((m, -c if first < 0 else c) for m, c in polynomial.items())
