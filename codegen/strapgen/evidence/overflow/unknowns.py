"""What is known of an integer that a C program computes: its type, an interval, and a formula in real numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import z3

from strapgen.evidence.overflow.c_types import IntegerType


@dataclass(frozen=True)
class Fact:
    """A formula that holds, with the variables in it."""

    formula: Any
    variables: frozenset[Variable]

    def negated(self) -> Fact:
        """Return the opposite."""
        return Fact(z3.Not(self.formula), self.variables)

    def where(self, path: Iterable[Fact]) -> Fact:
        """Return the fact that it holds where all conditions of a path do."""
        path = [*path]
        if not path:
            return self
        formula = z3.Implies(z3.And([condition.formula for condition in path]), self.formula)
        return Fact(formula, self.variables.union(*(condition.variables for condition in path)))


@dataclass(eq=False)
class Variable:
    """An integer unknown: an input, or a result that is rounded or chosen."""

    name: str
    #: Its interval, as far as it is proved
    low: int
    high: int
    #: The conditions of the branch in which it was computed: the interval and the facts hold where they do
    path: tuple[Fact, ...] = ()

    def __post_init__(self) -> None:
        self.real = z3.Real(self.name)
        self.facts: list[Fact] = []

    def known(self, path: Sequence[Fact]) -> list[Fact]:
        """Return what is known of it on a path: its interval, and what defines it."""
        interval = Fact(z3.And(self.real >= self.low, self.real <= self.high), frozenset([self]))
        further = [condition for condition in self.path if condition not in path]
        return [fact.where(further) for fact in (interval, *self.facts)]


@dataclass(frozen=True)
class Number:
    """The value of an expression."""

    kind: IntegerType
    low: int
    high: int
    #: Its formula
    real: Any
    #: Those of the formula
    variables: frozenset[Variable] = frozenset()

    @classmethod
    def constant(cls, value: int, kind: IntegerType) -> Number:
        """Return a constant."""
        return cls(kind, value, value, value)

    @classmethod
    def of(cls, variable: Variable, kind: IntegerType) -> Number:
        """Return a variable's value."""
        return cls(kind, variable.low, variable.high, variable.real, frozenset([variable]))

    def narrowed(self) -> Number:
        """Return it with the interval that is known by now, if it is one variable."""
        for variable in self.variables:
            if variable.real is self.real:
                low, high = max(self.low, variable.low), min(self.high, variable.high)
                return Number(self.kind, low, high, self.real, self.variables)
        return self

    def between(self, low: int, high: int) -> Number:
        """Return it with an interval that is known to hold, and what is known already."""
        return Number(self.kind, max(low, self.low), min(high, self.high), self.real, self.variables)

    def as_type(self, kind: IntegerType) -> Number:
        """Return the same integer with another type."""
        return Number(kind, self.low, self.high, self.real, self.variables)

    @property
    def exact(self) -> bool:
        """Whether it can be one integer only."""
        return self.low == self.high


# Facts about more unknowns than these have not decided anything, but cost time.
_MOST_VARIABLES = 40


class Prover:
    """Decides formulas by z3, from few facts at first and from more as long as they do not do.

    `effort`: what one attempt may take, in z3's own count, so that the outcome does not depend on the machine.
    """

    def __init__(self, effort: int) -> None:
        self._effort = effort
        self.path: list[Fact] = []

    def within(self, number: Number, low: int, high: int) -> bool:
        """Return whether a number is proved to lie between two ends."""
        below = number.high <= high or self.holds(Fact(number.real <= high, number.variables))
        return below and (number.low >= low or self.holds(Fact(number.real >= low, number.variables)))

    def holds(self, claim: Fact) -> bool:
        """Return whether a formula is proved for all integers that meet the facts and the conditions of the path.

        The unknowns are real numbers in the formulas, of which the integers are some.
        """
        known: set[Variable] = set(claim.variables)
        while True:
            if self._follows(claim, known):
                return True
            further = {v for variable in known for fact in variable.known(self.path) for v in fact.variables}
            further |= {v for fact in self.path for v in fact.variables} | known
            if further == known or len(further) > _MOST_VARIABLES:
                return False
            known = further

    def _follows(self, claim: Fact, known: set[Variable]) -> bool:
        """Return whether a claim follows from the intervals and the facts between some variables."""
        solver = z3.SolverFor("QF_NRA")
        solver.set("rlimit", self._effort)
        facts = [*self.path, *(fact for variable in known for fact in variable.known(self.path))]
        solver.add(*_closed(facts, known), z3.Not(claim.formula))
        return bool(solver.check() == z3.unsat)


def _closed(facts: Iterable[Fact], known: set[Variable]) -> list[Any]:
    """Return the formulas in which no other variable stands."""
    return [fact.formula for fact in facts if fact.variables <= known]
