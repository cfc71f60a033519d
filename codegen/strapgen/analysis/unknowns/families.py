"""Families of solutions of polynomial equations: unknowns as functions of those that are free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import sympy as sp

from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.kernel import power_series, reading
from strapgen.results.records import entry, properties


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
    """

    label: str
    order: int = field(metadata=entry(key="power"))
    value: sp.Expr = field(metadata=entry(key="expression"))

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"{self.label}: {self.value} = 0"


def _shown(expressions: Sequence[sp.Expr]) -> list[str]:
    return list(map(shown, expressions))


@dataclass(frozen=True)
class Family:
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
    """

    computed = properties(dimension=entry())

    values: dict[sp.Symbol, sp.Expr] = field(metadata=entry(kind=dict[str, str]))
    free: tuple[sp.Symbol, ...] = field(metadata=entry(key="parameters", kind=list[str]))
    nonzero: tuple[sp.Expr, ...] = field(default=(), metadata=entry(write=_shown, kind=list[str]))
    equations: tuple[sp.Expr, ...] = field(default=(), metadata=entry(write=_shown, kind=list[str]))

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
        """Tell whether an expression in the unknowns is zero for all members of the family."""
        numerator = sp.numer(sp.together(expression.xreplace(self.values)))
        numerator = sp.expand(numerator)
        if numerator == 0 or not self.equations:
            return bool(numerator == 0)
        _, rest = sp.reduced(numerator, list(self.equations), *self.free)
        return bool(rest == 0)


@dataclass(frozen=True)
class PolynomialSolution:
    """What equations say of their unknowns.

    Parameters
    ----------
    unknowns : tuple of Symbol
    families : tuple of Family
        The families of all solutions, those with most parameters first; empty if there is none.
    reason : str
        Why there is no solution; "" if there is one.
    solvable : int or None
        If there is no solution, the highest order up to which the equations have one; None if not even the lowest have.
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
