"""Writes plans as straight-line code on scalars."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

from strapgen.ir.program import Assignment, Constant, Node, Operation, Reference
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import CROSS
from strapgen.kernel.polynomials import Polynomial, ratio
from strapgen.lowering.canonical.plan import Cross, Plan, Sides, Weighted, unsigned
from strapgen.lowering.canonical.vectors import choose_products
from strapgen.lowering.trees import (
    Term,
    chain,
    expanded,
    gathered,
    plain,
    scaled,
    signed_sum,
    with_constant,
)

#: A summand of a vector: its coefficient, its weight unless that is a number, and the name of the vector.
_Summand = tuple[Fraction, Reference | None, str]


class _NameClashError(ValueError):
    """A vector of the kernel has the name of a quantity that canonical forms have."""


def write(plan: Plan, offered: Sequence[str], transition: Signal) -> list[Assignment] | None:
    """Return the assignments of a transition; None where a name would stand for two quantities.

    The scalar products are those of the vectors on offer, which lie in the span of the plan's basis.
    """
    writer = _Writer(plan, offered)
    try:
        if transition.shape == (3, 3):
            return writer.matrix(transition.elements)
        return writer.quaternion(next(name for name in transition.elements if name.endswith("s")))
    except _NameClashError:  # another basis has other names, and the stages have their own
        return None


class _Writer:
    def __init__(self, plan: Plan, offered: Sequence[str]) -> None:
        self._plan = plan
        self._body: list[Assignment] = []
        inputs = (v.name for v in plan.pool.vectors.values() if not v.parts)
        self._names: dict[str, Node] = {
            n: Reference(n) for v in inputs for n in (f"{v}_{axis}" for axis in "xyz")
        }
        self._scalar_products: set[str] = set()
        self._scalars: list[tuple[Polynomial, str]] = []
        vectors = plan.pool.vectors
        polynomials = plan.polynomials()
        basis = [(name, vectors[name].form) for name in plan.basis]
        chosen = choose_products(polynomials, basis, {name: vectors[name].form for name in offered})
        self._chosen = {_key(p): q for p, q in zip(polynomials, chosen, strict=True)}

    def quaternion(self, scalar: str) -> list[Assignment]:
        """Return the assignments of a quaternion, whose scalar part has this name."""
        self._definitions()
        (name,) = self._plan.scalars
        polynomial, meaning = self._plan.scalars[name]
        self._assign(scalar, plain(self._tree(self._chosen[_key(polynomial)])), meaning)
        return self._body

    def matrix(self, elements: Sequence[str]) -> list[Assignment]:
        """Return the assignments of a matrix, whose elements are named row by row."""
        self._definitions()
        polynomial, meaning = self._plan.scalars["diagonal"]
        weight, diagonal = self._weight(polynomial, "diagonal", meaning)
        base = scaled(weight, diagonal) if diagonal else (weight > 0, Constant(abs(weight)))
        skewed = any(d.name == "skew" for d in self._plan.definitions)
        outers = self._plan.outers
        both = [o for o in outers if o.sides is Sides.BOTH]
        for i, axis in enumerate("xyz"):
            terms = [(True, node) for node in self._diagonal(axis)]
            if both:
                half = f"half_{axis}{axis}"
                products = [_product(f"{o.vector}_{axis}", f"{o.partner}_{axis}") for o in both]
                self._assign(half, chain("add", products), "" if i else "half of u y' + y u' on the diagonal")
                terms += [(True, Reference(half))] * 2
            self._assign(elements[4 * i], plain(signed_sum([*terms, base])))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            a, b = "xyz"[i], "xyz"[j]
            symmetric = self._outers(a, b, (Sides.BOTH, Sides.PARALLEL)) + [
                _product(f"{o.vector}_{b}", f"{o.partner}_{a}") for o in both
            ]
            shared: list[Term] = []
            if symmetric:
                self._assign(f"symmetric_{a}{b}", chain("add", symmetric))
                shared = [(True, Reference(f"symmetric_{a}{b}"))]
            for row, column, positive in ((i, j, False), (j, i, True)):
                first, second = "xyz"[row], "xyz"[column]
                products = self._outers(first, second, (Sides.RIGHT,)) + self._outers(
                    second, first, (Sides.LEFT,)
                )
                terms = [*shared, *((True, node) for node in products)]
                if skewed:
                    terms.append((positive, Reference(f"skew_{'xyz'[k]}")))
                node = plain(signed_sum(terms)) if terms else Constant(Fraction(0))
                self._assign(elements[3 * row + column], node)
        return self._body

    def _outers(self, a: str, b: str, sides: tuple[Sides, ...]) -> list[Node]:
        """Return the products of vectors on axis a with their partners on axis b."""
        return [
            _product(f"{o.vector}_{a}", f"{o.partner}_{b}") for o in self._plan.outers if o.sides in sides
        ]

    def _diagonal(self, axis: str) -> list[Node]:
        """Return the diagonal elements of one-sided outer products, with the partners of each vector summed first."""
        partners: dict[str, list[Node]] = {}
        for o in self._plan.outers:
            if o.sides is not Sides.BOTH:
                partners.setdefault(o.vector, []).append(Reference(f"{o.partner}_{axis}"))
        return [
            Operation("multiply", (Reference(f"{vector}_{axis}"), chain("add", others)))
            for vector, others in partners.items()
        ]

    def _definitions(self) -> None:
        for linear in self._plan.pool.vectors.values():
            if linear.parts:
                self._vector(linear.name, [(c, None, name) for c, name in linear.parts], linear.meaning)
        weighted = [d for d in self._plan.definitions if isinstance(d, Weighted)]
        uses = Counter((unsigned(self._chosen[_key(p)]), v) for d in weighted for p, v in d.terms)
        for definition in self._plan.definitions:
            if isinstance(definition, Cross):
                self._cross(definition)
                continue
            summands: list[_Summand] = []
            for polynomial, vector in definition.terms:
                name, meaning = f"{definition.name}_{vector}", f"weight of {vector} in {definition.name}"
                factor, weight = self._weight(polynomial, name, meaning)
                if weight is not None and uses[unsigned(self._chosen[_key(polynomial)]), vector] > 1:
                    product = f"{vector}_times_{weight.name}"
                    self._vector(product, [(Fraction(1), weight, vector)], "")
                    weight, vector = None, product
                summands.append((factor, weight, vector))
            self._vector(definition.name, summands, definition.meaning)

    def _vector(self, name: str, summands: list[_Summand], meaning: str) -> None:
        for axis in "xyz":
            terms = []
            for factor, weight, vector in summands:
                element: Node = Reference(f"{vector}_{axis}")
                terms.append((factor, Operation("multiply", (weight, element)) if weight else element))
            self._assign(f"{name}_{axis}", plain(with_constant(gathered(terms), Fraction(0))), meaning)
            meaning = ""

    def _cross(self, definition: Cross) -> None:
        for axis, (i, j) in zip("xyz", CROSS, strict=True):
            a, b = "xyz"[i], "xyz"[j]
            products = (
                _product(f"{definition.left}_{a}", f"{definition.right}_{b}"),
                _product(f"{definition.left}_{b}", f"{definition.right}_{a}"),
            )
            self._assign(f"{definition.name}_{axis}", Operation("subtract", products))

    def _weight(self, polynomial: Polynomial, name: str, meaning: str) -> tuple[Fraction, Reference | None]:
        """Return a weight as a number times a computed scalar, or as a number alone."""
        chosen = self._chosen[_key(polynomial)]
        if chosen.keys() <= {()}:
            return chosen.get((), Fraction(0)), None
        best: Term | None = None
        body = {m: c for m, c in chosen.items() if m}
        for known, known_name in self._scalars:
            factor = ratio(chosen, known)
            if factor is not None and abs(factor) == 1:
                return factor, Reference(known_name)
            factor = ratio(body, {m: c for m, c in known.items() if m})
            if factor is not None and best is None:
                offset = chosen.get((), Fraction(0)) - factor * known.get((), Fraction(0))
                best = with_constant([scaled(factor, Reference(known_name))], offset)
                if abs(factor) != 1 and len(body) == 1 and offset:
                    best = None
        positive, node = best or self._tree(chosen)
        self._assign(name, node, meaning)
        self._scalars.append((chosen if positive else {m: -c for m, c in chosen.items()}, name))
        return Fraction(1 if positive else -1), Reference(name)

    def _tree(self, polynomial: Polynomial) -> Term:
        return expanded(polynomial, self._product_node)

    def _product_node(self, factor: tuple[str, ...]) -> Node:
        name = "_dot_".join(factor[:2]) + "".join(f"_cross_{n}" for n in factor[2:])
        if name not in self._scalar_products:
            self._scalar_products.add(name)
            if len(factor) == 3:
                crosses = [d for d in self._plan.definitions if isinstance(d, Cross)]
                for k in range(3):
                    one, left, right = factor[k:] + factor[:k]
                    if Cross(f"{left}_cross_{right}", left, right) in crosses:
                        break
                else:
                    one, left, right = factor
                cross = Cross(f"{left}_cross_{right}", left, right)
                self._cross(cross)
                pair = (one, cross.name)
            else:
                pair = (factor[0], factor[1])
            terms = [_product(f"{pair[0]}_{axis}", f"{pair[1]}_{axis}") for axis in "xyz"]
            self._assign(name, chain("add", terms))
        return Reference(name)

    def _assign(self, name: str, node: Node, meaning: str = "") -> None:
        known = self._names.setdefault(name, node)
        if known != node:
            raise _NameClashError(f"{name} would stand for two quantities")
        if known is node:
            self._body.append(Assignment(name, node, meaning))


def _product(a: str, b: str) -> Node:
    return Operation("multiply", (Reference(a), Reference(b)))


def _key(polynomial: Polynomial) -> frozenset[object]:
    return frozenset(polynomial.items())
