"""Solves systems of polynomial equations exactly, in families with free parameters.

An unknown that stands linearly in an equation is replaced by the quotient of the rest and of its coefficient, where
that is not zero; where it may be zero, that is another case. An equation that is a product gives a case for each
factor. Where no unknown is linear and nothing is a product, a Groebner basis takes the place of the equations. The
cases exclude each other, and together they hold all solutions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp
from sympy.core.random import rng
from sympy.polys.groebnertools import groebner
from sympy.polys.orderings import grevlex, lex

from strapgen.analysis.unknowns.families import Equation, Family, PolynomialSolution, simple, with_roots
from strapgen.analysis.unknowns.ring_quotients import (
    cancelled,
    linear_coefficient,
    may_divide,
    quotient_of,
    substituted,
    without,
)
from strapgen.ir.exceptions import InputError
from strapgen.kernel.power_series import field

#: Most cases that are looked at, most terms of an equation, and most unknowns.
MOST_CASES, MOST_TERMS, MOST_UNKNOWNS = 400, 5000, 40
#: Largest systems for which a Groebner basis is computed: unknowns, equations, and the sum of the equations' degrees.
MOST_IN_BASIS, MOST_EQUATIONS, MOST_DEGREES = 5, 12, 40


@dataclass(frozen=True)
class _Case:
    """A branch of the search: equations that are left, what is not zero, and what is solved.

    Each of `values` is the number of an unknown with the numerator and the denominator of what it equals, in unknowns
    that later ones may replace.
    """

    equations: tuple[tuple[str, Any], ...]
    nonzero: tuple[Any, ...] = ()
    values: tuple[tuple[int, Any, Any], ...] = ()
    reduced: bool = False


class _ImpossibleError(Exception):
    """The equation that a case contradicts."""


def solve(equations: Sequence[Equation], unknowns: Sequence[sp.Symbol]) -> PolynomialSolution:
    """Return all real solutions of polynomial equations as families.

    >>> x, y = sp.symbols("x y", real=True)
    >>> line, circle = Equation("line", 1, x + y - 1), Equation("circle", 2, x**2 + y**2 - 1)
    >>> [family.values for family in solve([line], [x, y]).families]
    [{y: 1 - x}]
    >>> [family.values for family in solve([line, circle], [x, y]).families]
    [{x: 0, y: 1}, {x: 1, y: 0}]
    >>> solve([line, Equation("parallel", 2, x + y)], [x, y]).reason
    'parallel is 1 with the values that the others leave, and has to be 0'
    """
    if len(unknowns) > MOST_UNKNOWNS:
        raise InputError(f"there are {len(unknowns)} unknowns; at most {MOST_UNKNOWNS} are allowed")
    # SymPy factors polynomials at random points: with the same ones a search takes the same way every time.
    state = rng.getstate()
    rng.seed(1)
    try:
        return _solved(_CaseSearch(equations, unknowns))
    finally:
        rng.setstate(state)


def _solved(search: _CaseSearch) -> PolynomialSolution:
    """Return the solution of a system, order by order."""
    unknowns, equations = search.unknowns, search.equations
    cases, solvable = [_Case(())], None
    for order in sorted(equations):
        refined = search.refined(cases, order)
        if not refined:
            return PolynomialSolution(tuple(unknowns), (), search.reason, solvable)
        cases, solvable = refined, order
    families = [family for case in cases for family in with_roots(search.family(case))]
    families.sort(key=lambda family: (-family.dimension, len(family.equations)))
    return PolynomialSolution(tuple(unknowns), tuple(families), "", solvable)


class _CaseSearch:
    """Goes through the cases of a system."""

    def __init__(self, equations: Sequence[Equation], unknowns: Sequence[sp.Symbol]) -> None:
        self.unknowns = list(unknowns)
        numbers = field([equation.value for equation in equations])
        self.ring = sp.polys.rings.PolyRing(self.unknowns, numbers, lex)
        self.equations: dict[int, list[tuple[str, Any]]] = {}
        for equation in equations:
            numerator, divisor = sp.fraction(sp.together(equation.value))
            value = equation.value if divisor.is_number else numerator
            polynomial = self.ring.from_expr(sp.expand(value))
            self.equations.setdefault(equation.order, []).append((equation.label, polynomial))
        self.factored: dict[Any, list[Any]] = {}
        self.reason = ""
        self.looked_at = 0

    def refined(self, cases: list[_Case], order: int) -> list[_Case]:
        """Return the cases in which the equations of an order hold too."""
        more = sorted(self.equations[order], key=lambda item: len(item[1]))
        for label, polynomial in more:
            if polynomial and polynomial.is_ground:
                number = self.ring.domain.to_sympy(polynomial.LC)
                self.reason = f"{label} is {number}, whatever the unknowns are, and has to be 0"
                return []
        waiting, settled, reasons = [], [], []
        for case in reversed(cases):
            waiting.append(
                replace(
                    case,
                    equations=(*case.equations, *((label, self.inserted(p, case)) for label, p in more)),
                    reduced=False,
                )
            )
        while waiting:
            self.looked_at += 1
            if self.looked_at > MOST_CASES:
                raise InputError(f"the conditions fall into more than {MOST_CASES} cases, which is the limit")
            try:
                case = self.simplified(waiting.pop())
                following = self.split(case) if case.equations else []
                if not following:
                    self.require_real(case)
            except _ImpossibleError as error:
                reasons.append(str(error))
                continue
            if following:
                waiting += reversed(following)
            else:
                settled.append(case)
        self.reason = reasons[0] if reasons else ""
        return settled

    # Polynomials

    def inserted(self, polynomial: Any, case: _Case) -> Any:
        """Return the numerator of a polynomial after the values of a case are inserted."""
        for place, top, bottom in case.values:
            polynomial = substituted(polynomial, place, top, bottom)
        return polynomial

    def factors(self, polynomial: Any) -> list[Any]:
        """Return the irreducible factors of a polynomial."""
        if len(polynomial) > MOST_TERMS:
            raise InputError(f"a condition has over {MOST_TERMS} terms, which is the limit")
        if polynomial not in self.factored:
            self.factored[polynomial] = self.factors_at_first(polynomial)
        return self.factored[polynomial]

    def factors_at_first(self, polynomial: Any) -> list[Any]:
        """Return the factors of a polynomial that was not factored before."""
        for place in range(len(self.unknowns)):
            coefficient = linear_coefficient(polynomial, place)
            if (
                coefficient is not None
            ):  # what the coefficient and the rest share is all that can be split off
                common = coefficient.gcd(without(polynomial, place, coefficient))
                rest = [] if common.is_ground else self.factors(common)
                return [*rest, polynomial.exquo(common).monic()]
        return [factor.monic() for factor, _ in polynomial.factor_list()[1]]

    def simplified(self, case: _Case) -> _Case:
        """Return a case without what is known not to be zero, and without equations that hold."""
        shortest: dict[Any, tuple[str, Any]] = {}
        for label, polynomial in case.equations:
            if not polynomial:
                continue
            if polynomial.is_ground:
                raise _ImpossibleError(f"{label} {self.contradiction(case, polynomial)}")
            for factor in case.nonzero:
                while may_divide(factor, polynomial):
                    quotient, rest = divmod(polynomial, factor)
                    if rest:
                        break
                    polynomial = quotient
            if polynomial.is_ground:
                raise _ImpossibleError(f"{label} needs a factor to vanish that the others exclude")
            shortest.setdefault(polynomial.monic(), (label, polynomial))
        return replace(case, equations=tuple(sorted(shortest.values(), key=lambda item: len(item[1]))))

    def contradiction(self, case: _Case, polynomial: Any) -> str:
        """Return why a number that is not zero is left of an equation."""
        if all(bottom == 1 for _, _, bottom in case.values):  # as it was, but for the values
            number = self.ring.domain.to_sympy(polynomial.LC)
            return f"is {number} with the values that the others leave, and has to be 0"
        return "contradicts what the others leave"

    # Cases

    def split(self, case: _Case) -> list[_Case]:
        """Return the cases that follow from one; none if nothing more can be solved."""
        pivots = sorted(self.pivots(case), key=lambda item: item[0])
        if pivots and not pivots[0][0][0]:
            _, number, place, coefficient = pivots[0]
            return [self.solved(case, number, place, coefficient)]
        for number, (label, polynomial) in enumerate(case.equations):
            factors = self.factors(polynomial)
            if len(factors) > 1 or factors[0] != polynomial.monic():
                return self.by_factor(case, number, label, factors)
        if pivots:
            _, number, place, coefficient = pivots[0]
            label, polynomial = case.equations[number]
            vanishing = ((label, coefficient), (label, without(polynomial, place, coefficient)))
            rest = (*case.equations[:number], *case.equations[number + 1 :])
            other = replace(case, equations=(*vanishing, *rest), reduced=False)
            more = tuple(f for f in self.factors(coefficient) if f not in case.nonzero)
            generic = replace(case, nonzero=(*case.nonzero, *more))
            return [self.solved(generic, number, place, coefficient), other]
        return [] if case.reduced or len(case.equations) == 1 else [self.with_basis(case)]

    def require_real(self, case: _Case) -> None:
        """Refuse a case with an equation in one unknown that no real number solves."""
        for label, polynomial in case.equations:
            expression = polynomial.as_expr()
            if len(expression.free_symbols) != 1 or not self.ring.domain.is_QQ:
                continue
            if not sp.Poly(expression).count_roots():
                raise _ImpossibleError(
                    f"{label} leaves {sp.sstr(expression)} = 0, which no real number solves"
                )

    def pivots(self, case: _Case) -> Iterator[tuple[tuple[Any, ...], int, int, Any]]:
        """Yield equations in which an unknown is linear, those first whose coefficient is known not to be zero."""
        for number, (_, polynomial) in enumerate(case.equations):
            for place in range(len(self.unknowns)):
                coefficient = linear_coefficient(polynomial, place)
                if coefficient is None:
                    continue
                sure = coefficient.is_ground or all(f in case.nonzero for f in self.factors(coefficient))
                size = len(coefficient) * len(polynomial)
                yield (not sure, not coefficient.is_ground, -place, size), number, place, coefficient

    def solved(self, case: _Case, number: int, place: int, coefficient: Any) -> _Case:
        """Return a case in which one equation gives an unknown, which is replaced everywhere."""
        _, polynomial = case.equations[number]
        top, bottom = -without(polynomial, place, coefficient), coefficient
        common = bottom if bottom.is_ground else top.gcd(bottom)
        top, bottom = top.quo(common), bottom.quo(common)
        rest = (*case.equations[:number], *case.equations[number + 1 :])
        nonzero: list[Any] = []
        for factor in case.nonzero:
            inserted = substituted(factor, place, top, bottom)
            if not inserted:
                raise _ImpossibleError(
                    f"{case.equations[number][0]} makes {factor.as_expr()} vanish, which the others exclude"
                )
            if not inserted.is_ground:
                nonzero += [f for f in self.factors(inserted) if f not in nonzero]
        return replace(
            case,
            equations=tuple((label, substituted(p, place, top, bottom)) for label, p in rest),
            nonzero=tuple(nonzero),
            values=(*case.values, (place, top, bottom)),
        )

    def by_factor(self, case: _Case, number: int, label: str, factors: Sequence[Any]) -> list[_Case]:
        """Return a case for each factor of an equation, in which those before it are not zero."""
        rest = (*case.equations[:number], *case.equations[number + 1 :])
        return [
            replace(
                case,
                equations=((label, factor), *rest),
                nonzero=tuple(dict.fromkeys((*case.nonzero, *factors[:k]))),
            )
            for k, factor in enumerate(factors)
        ]

    def with_basis(self, case: _Case) -> _Case:
        """Return a case with a Groebner basis in place of its equations."""
        polynomials = [p for _, p in case.equations]
        held = {place for p in polynomials for place in range(len(self.unknowns)) if p.degree(place) > 0}
        degrees = sum(max(map(sum, p.monoms())) for p in polynomials)
        if len(held) > MOST_IN_BASIS or len(polynomials) > MOST_EQUATIONS or degrees > MOST_DEGREES:
            raise InputError(
                f"{len(polynomials)} equations in {len(held)} unknowns are left in which none is linear; a Groebner "
                f"basis is computed of at most {MOST_EQUATIONS} in {MOST_IN_BASIS}, of total degree {MOST_DEGREES}"
            )
        label = f"a Groebner basis of {'; '.join(dict.fromkeys(label for label, _ in case.equations))}"
        graded = self.ring.clone(order=grevlex)
        basis = [p.set_ring(self.ring) for p in groebner([p.set_ring(graded) for p in polynomials], graded)]
        return replace(case, equations=tuple((label, p) for p in basis), reduced=True)

    # Families

    def family(self, case: _Case) -> Family:
        """Return a settled case as a family."""
        quotients: dict[int, tuple[Any, Any]] = {}
        for place, top, bottom in reversed(case.values):
            for other, (x, y) in quotients.items():
                top, bottom = cancelled(*quotient_of(top, bottom, other, x, y))
            quotients[place] = top, bottom
        values = {
            self.unknowns[place]: simple(top.as_expr() / bottom.as_expr())
            for place, (top, bottom) in sorted(quotients.items())
        }
        free = tuple(symbol for symbol in self.unknowns if symbol not in values)
        nonzero = tuple(p.as_expr() for p in case.nonzero)
        return Family(values, free, nonzero, tuple(p.as_expr() for _, p in case.equations))
