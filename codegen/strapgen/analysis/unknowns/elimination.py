"""Solves systems of polynomial equations exactly, in families with free parameters.

An unknown that stands linearly in an equation is replaced by the quotient of the rest and of its coefficient, where
that is not zero; where it may be zero, that is another case. An equation that is a product gives a case for each
factor. Where no unknown is linear and nothing is a product, a Groebner basis takes the place of the equations. The
cases exclude each other, and together they hold all solutions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from operator import le
from typing import Any, ClassVar

import sympy as sp
from sympy.core.random import rng
from sympy.polys.groebnertools import groebner
from sympy.polys.orderings import grevlex, lex

from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.kernel import power_series, reading
from strapgen.results.records import Properties, entry, properties


@dataclass(frozen=True)
class Equation:
    """A polynomial that has to be zero.

    Parameters
    ----------
    label : str
        What it says, in words or as a formula.
    order : int
        Its order; those of lower orders are solved first.
    value : Expr
        A polynomial in the unknowns, or a quotient whose numerator has to be zero.

    Examples
    --------
    >>> Equation("the sum of the weights", 1, sp.Symbol("b1") + sp.Symbol("b2") - 1).order
    1
    """

    label: str
    order: int = field(metadata=entry(key="power"))
    value: sp.Expr = field(metadata=entry(key="expression"))

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"{self.label}: {self.value} = 0"


def _repr(expressions: Sequence[sp.Expr]) -> list[str]:
    return list(map(shown, expressions))


@dataclass(frozen=True)
class Family(ReadOnly):
    """Solutions with free parameters.

    Parameters
    ----------
    values : dict of Symbol to Expr
        Every unknown that is not free, as a function of those that are.
    free : tuple of Symbol
        Unknowns with any value, except where `nonzero` vanishes; some are tied by `equations`.
    nonzero : tuple of Expr
        Polynomials in the free unknowns that must not be zero.
    equations : tuple of Expr
        Irreducible polynomials in the free unknowns that must be zero; empty for almost all families.

    Examples
    --------
    >>> a, b = sp.symbols("a b")
    >>> family = Family({b: 1 - a}, (a,))
    >>> family.dimension, family.holds(a + b - 1)
    (1, True)
    """

    computed: ClassVar[Properties] = properties(dimension=entry())

    values: Mapping[sp.Symbol, sp.Expr] = field(metadata=entry(kind=dict[str, str]))
    free: tuple[sp.Symbol, ...] = field(metadata=entry(key="parameters", kind=list[str]))
    nonzero: tuple[sp.Expr, ...] = field(default=(), metadata=entry(write=_repr, kind=list[str]))
    equations: tuple[sp.Expr, ...] = field(default=(), metadata=entry(write=_repr, kind=list[str]))

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        free = ", ".join(symbol.name for symbol in self.free)
        values = ", ".join(f"{symbol} = {value}" for symbol, value in self.values.items())
        return f"free {free or 'nothing'}\n{values or 'no other unknowns'}"

    @property
    def dimension(self) -> int:
        """Number of parameters that can be chosen."""
        return len(self.free) - len(self.tied)

    @property
    def tied(self) -> tuple[sp.Symbol, ...]:
        """Free unknowns that the equations fix up to finitely many values, once the others are chosen."""
        held = [symbol for symbol in self.free if any(symbol in x.free_symbols for x in self.equations)]
        leading = [sp.Poly(x, *held).monoms(order="grevlex")[0] for x in self.equations]
        # The others are a largest set of unknowns in which alone no leading monomial stands.
        for count in range(len(held), -1, -1):
            for chosen in combinations(range(len(held)), count):
                if all(any(power for k, power in enumerate(m) if k not in chosen) for m in leading):
                    return tuple(symbol for k, symbol in enumerate(held) if k not in chosen)
        return ()

    def holds(self, expression: sp.Expr) -> bool:
        """Return whether an expression in the unknowns is zero for all members of the family."""
        numerator = sp.numer(sp.together(expression.xreplace(self.values)))
        numerator = sp.expand(numerator)
        if numerator == 0 or not self.equations:
            return bool(numerator == 0)
        _, rest = sp.reduced(numerator, list(self.equations), *self.free)
        return bool(rest == 0)


@dataclass(frozen=True)
class PolynomialSolution:
    """The solutions of polynomial equations, as families.

    Parameters
    ----------
    unknowns : tuple of Symbol
    families : tuple of Family
        The families of all solutions, those with most parameters first; empty if there is none.
    reason : str
        Why there is no solution; "" if there is one.
    solvable : int or None
        If there is no solution, the highest order up to which the equations have one; None if not even the lowest have.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> solve([Equation("a square", 1, x**2 - 4)], [x]).families[0].values
    {x: 2}
    """

    unknowns: tuple[sp.Symbol, ...] = field(metadata=entry(kind=list[str]))
    families: tuple[Family, ...]
    reason: str = field(default="", metadata=entry(write=lambda reason: reason or None, kind=str | None))
    solvable: int | None = field(default=None, metadata=entry(key="solvable_order"))

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        names = ", ".join(symbol.name for symbol in self.unknowns)
        return f"of {names}: " + (self.reason or counted(len(self.families), "family", "families"))


def simple(expression: sp.Expr) -> sp.Expr:
    """Return an expression in the shorter of two forms: factored, or with brackets multiplied out."""
    factored = sp.factor(expression)
    if not factored.is_polynomial():
        return factored
    expanded = sp.expand(expression)
    return factored if len(str(factored)) < len(str(expanded)) else expanded


def shown(polynomial: sp.Expr) -> str:
    """Return a polynomial as text with whole numbers, up to a factor.

    >>> shown(sp.Symbol("c") - sp.Rational(2, 3))
    '3*c - 2'
    """
    if polynomial.free_symbols and power_series.field([polynomial]) == sp.QQ:
        polynomial = sp.Poly(polynomial, *polynomial.free_symbols, domain=sp.QQ).clear_denoms(convert=True)[1]
        polynomial = polynomial.primitive()[1].as_expr()
    return str(sp.sstr(polynomial))


def member(family: Family, what: str, parameters: Mapping[str, Any]) -> dict[str, sp.Expr]:
    """Return the values of all unknowns of a family that parameters fix."""
    chosen = reading.values_of_unknowns(what, tuple(symbol.name for symbol in family.free), parameters)
    for excluded in family.nonzero:
        if sp.expand(excluded.subs(chosen)) == 0:
            raise InputError(f"{what}: {shown(excluded)} is 0 with these values; the family excludes it")
    for equation in family.equations:
        rest = sp.expand(equation.subs(chosen))
        if rest.is_number and rest != 0:
            raise InputError(f"{what}: {shown(equation)} has to be 0; with these values it is {rest}")
    values = {symbol: sp.cancel(value.subs(chosen)) for symbol, value in family.values.items()}
    return {symbol.name: value for symbol, value in {**chosen, **values}.items()}


def with_roots(family: Family) -> list[Family]:
    """Return a family with the roots of an equation of second degree in one unknown in its place."""
    if len(family.equations) != 1 or len(family.equations[0].free_symbols) != 1:
        return [family]
    (equation,), (symbol,) = family.equations, family.equations[0].free_symbols
    polynomial = sp.Poly(equation, symbol)
    if polynomial.degree() != 2:
        return [family]
    a, b, c = polynomial.all_coeffs()
    roots = [sp.expand((-b + sign * sp.sqrt(b * b - 4 * a * c)) / (2 * a)) for sign in (-1, 1)]
    free = tuple(other for other in family.free if other != symbol)
    families = []
    for root in roots:
        values = {name: sp.radsimp(sp.expand(x.subs(symbol, root))) for name, x in family.values.items()}
        nonzero = tuple(sp.expand(x.subs(symbol, root)) for x in family.nonzero)
        families.append(Family({symbol: root, **values}, free, tuple(x for x in nonzero if x.free_symbols)))
    return families


#: Most cases that are looked at, most terms of an equation, and most unknowns.
MOST_CASES, MOST_TERMS, MOST_UNKNOWNS = 400, 5000, 40
#: Largest systems for which a Groebner basis is computed: unknowns, equations, and the sum of the equations' degrees.
MOST_IN_BASIS, MOST_EQUATIONS, MOST_DEGREES = 5, 12, 40


@dataclass(frozen=True)
class _Case:
    """A branch of the search: remaining equations, factors that are not zero, and solved unknowns.

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
        return _solve_by_order(_CaseSearch(equations, unknowns))
    finally:
        rng.setstate(state)


def _solve_by_order(search: _CaseSearch) -> PolynomialSolution:
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
        numbers = power_series.field([equation.value for equation in equations])
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
                case = self.simplify(waiting.pop())
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

    def simplify(self, case: _Case) -> _Case:
        """Return a case without factors that are not zero, and without equations that hold."""
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
        """Return the reason of a contradiction: an equation that is a number other than zero."""
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
