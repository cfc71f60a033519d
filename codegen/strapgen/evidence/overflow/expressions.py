"""Expressions of C as intervals and formulas; each possible overflow becomes a proof obligation.

A `Number` is what is known of an integer: its type, an interval, and a formula in real numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import z3
from pycparser import c_ast

from strapgen.evidence.overflow.c_types import IntegerType, Model


@dataclass(frozen=True)
class Obligation:
    """A condition for defined behaviour of the C that is not proved."""

    #: The function, and the value or the statement in it
    place: str
    text: str


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
        """Return interval and definition of the variable on a path."""
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
        """Return the number with the interval known on the present path, if it is one variable."""
        for variable in self.variables:
            if variable.real is self.real:
                low, high = max(self.low, variable.low), min(self.high, variable.high)
                return Number(self.kind, low, high, self.real, self.variables)
        return self

    def between(self, low: int, high: int) -> Number:
        """Return the number with the intersection of its interval and another one that holds."""
        return Number(self.kind, max(low, self.low), min(high, self.high), self.real, self.variables)

    def as_type(self, kind: IntegerType) -> Number:
        """Return the same integer with another type."""
        return Number(kind, self.low, self.high, self.real, self.variables)

    @property
    def exact(self) -> bool:
        """Whether it can be one integer only."""
        return self.low == self.high


class ExpressionFormulas:
    """Evaluates the expressions of one function.

    `calls`: ``calls(name, arguments)`` returns the result of a function of the file.
    """

    def __init__(
        self,
        model: Model,
        prover: Prover,
        calls: Callable[[str, list[Number]], Number],
        obligations: list[Obligation],
    ) -> None:
        self.model, self.prover, self._calls, self._obligations = model, prover, calls, obligations
        self.place = ""
        self._fresh = 0
        #: What was shifted down, by how much, and the result, where equal shifts are to have one result; else None
        self.shifted: list[tuple[Any, int, Variable]] | None = None

    def variable(self, low: int, high: int, name: str = "t") -> Variable:
        """Return a new unknown."""
        self._fresh += 1
        return Variable(f"{name}!{self._fresh}", low, high, tuple(self.prover.path))

    def _note(self, text: str) -> None:
        self._obligations.append(Obligation(self.place, text))

    def value(self, node: Any, known: Mapping[str, Number]) -> Number:
        """Return the value of an expression of integers."""
        match node:
            case c_ast.Constant():
                return Number.constant(*self.model.literal(node.value))
            case c_ast.ID():
                return known[node.name].narrowed()
            case c_ast.ArrayRef():
                return known[f"{node.name.name}[{node.subscript.value}]"].narrowed()
            case c_ast.Cast():
                kind = self.model.named(tuple(node.to_type.type.type.names))
                return self.converted(self.value(node.expr, known), kind)
            case c_ast.UnaryOp(op="-"):
                number = self._promote(self.value(node.expr, known))
                return self._fit(number.kind, -number.high, -number.low, -number.real, number.variables)
            case c_ast.UnaryOp(op="~"):
                number = self._promote(self.value(node.expr, known))
                assert number.kind.signed
                return self._fit(number.kind, ~number.high, ~number.low, -number.real - 1, number.variables)
            case c_ast.BinaryOp(op="&", left=c_ast.Cast() as cast, right=c_ast.Constant() as mask):
                return self._low_bits(self.value(cast.expr, known), cast, mask)
            case c_ast.BinaryOp():
                left, right = self.value(node.left, known), self.value(node.right, known)
                return self._binary(node.op, left, right)
            case c_ast.TernaryOp():
                return self._chosen(node, known)
            case c_ast.FuncCall():
                arguments = [self.value(argument, known) for argument in node.args.exprs]
                return self._calls(node.name.name, arguments)
        raise NotImplementedError(f"{type(node).__name__} in {self.place}")

    def _low_bits(self, number: Number, cast: c_ast.Cast, mask: c_ast.Constant) -> Number:
        """Return the low bits of a number that is read as one without a sign, of a type that is no shorter."""
        kind = self.model.named(tuple(cast.to_type.type.type.names))
        places = self.model.literal(mask.value)[0].bit_length()
        assert (
            not kind.signed and self.model.literal(mask.value)[0] == (1 << places) - 1 and places <= kind.bits
        )
        result = self.variable(0, (1 << places) - 1, "low_bits")
        above = self.floored(number, places)
        equal = result.real == number.real - (1 << places) * above.real
        result.facts.append(Fact(equal, number.variables | above.variables | {result}))
        return Number.of(result, kind)

    def _promote(self, number: Number) -> Number:
        return number.as_type(self.model.promoted(number.kind))

    def converted(self, number: Number, kind: IntegerType) -> Number:
        """Convert a number to another type: it must fit a signed type; an unsigned type keeps the low bits."""
        if kind.signed or number.low >= 0:
            if kind.low <= number.low and number.high <= kind.high:
                return number.as_type(kind)
            if kind.signed:
                return self._fit(kind, number.low, number.high, number.real, number.variables)
        return Number.of(self.variable(kind.low, kind.high, "low_bits"), kind)

    def _fit(
        self, kind: IntegerType, low: int, high: int, real: Any, variables: frozenset[Variable]
    ) -> Number:
        """Return a result, which a type with a sign must hold; one without keeps the low bits."""
        if kind.low <= low and high <= kind.high:
            return Number(kind, low, high, real, variables)
        if not kind.signed:
            return Number.of(self.variable(kind.low, kind.high, "low_bits"), kind)
        number = Number(kind, low, high, real, variables)
        if not self.prover.within(number, kind.low, kind.high):
            self._note(f"a result between {low} and {high} must fit into {kind.bits} bits")
        return Number(kind, max(low, kind.low), min(high, kind.high), real, variables)

    def _binary(self, operator: str, left: Number, right: Number) -> Number:
        if operator in ("<<", ">>"):
            return self._shift(operator, self._promote(left), right)
        kind = self.model.common(left.kind, right.kind)
        left, right = self.converted(left, kind), self.converted(right, kind)
        variables = left.variables | right.variables
        if operator == "+":
            return self._fit(
                kind, left.low + right.low, left.high + right.high, left.real + right.real, variables
            )
        if operator == "-":
            return self._fit(
                kind, left.low - right.high, left.high - right.low, left.real - right.real, variables
            )
        if operator == "*":
            ends = [a * b for a, b in product((left.low, left.high), (right.low, right.high))]
            low = 0 if left.real is right.real and min(ends) < 0 else min(ends)
            return self._fit(kind, low, max(ends), left.real * right.real, variables)
        if operator == "/":
            return self._quotient(kind, left, right)
        raise NotImplementedError(f"{operator} in {self.place}")

    def _shift(self, operator: str, left: Number, right: Number) -> Number:
        assert right.exact and 0 <= right.low < left.kind.bits, "the places of a shift are constant"
        factor = 1 << right.low
        self._at_least(left, 0, "what is shifted must not be negative")
        if operator == "<<":
            return self._fit(
                left.kind, left.low * factor, left.high * factor, left.real * factor, left.variables
            )
        return self.floored(left, right.low)

    def _at_least(self, number: Number, least: int, text: str) -> None:
        if not self.prover.within(number, least, number.high):
            self._note(text)

    def floored(self, number: Number, places: int) -> Number:
        """Return a number over a power of two, rounded down."""
        if not places:
            return number
        if number.exact:
            return Number.constant(number.low >> places, number.kind)
        unit = 1 << places
        for known, bits, result in self.shifted or ():
            if bits == places and known.eq(number.real):
                return Number.of(result, number.kind)
        result = self.variable(number.low >> places, number.high >> places)
        rest = number.real - unit * result.real
        result.facts.append(Fact(z3.And(rest >= 0, rest <= unit - 1), number.variables | {result}))
        if self.shifted is not None:
            self.shifted.append((number.real, places, result))
        return Number.of(result, number.kind)

    def _quotient(self, kind: IntegerType, left: Number, right: Number) -> Number:
        """Return a quotient of numbers that must not be negative."""
        self._at_least(left, 0, "what is divided must not be negative")
        self._at_least(right, 1, "what divides must be positive")
        low, high = max(left.low, 0) // max(right.high, 1), left.high // max(right.low, 1)
        result = self.variable(low, high, "quotient")
        rest = left.real - right.real * result.real
        result.facts.append(
            Fact(z3.And(rest >= 0, rest <= right.real - 1), left.variables | right.variables | {result})
        )
        return Number.of(result, kind)

    def rooted(self, square: Number, kind: IntegerType, nearest: bool) -> Number:
        """Return the square root of a number, which must not be negative."""
        self._at_least(square, 0, "what a root is taken of must not be negative")
        low, high = math.isqrt(max(square.low, 0)), math.isqrt(max(square.high, 0)) + nearest
        result = self.variable(low, high, "root")
        real = result.real
        bounds = (
            (real * real - real, real * real + real) if nearest else (real * real, real * real + 2 * real)
        )
        result.facts.append(
            Fact(z3.And(bounds[0] <= square.real, square.real <= bounds[1]), square.variables | {result})
        )
        return self.converted(Number.of(result, IntegerType(64)), kind)

    def _chosen(self, node: c_ast.TernaryOp, known: Mapping[str, Number]) -> Number:
        condition = self.condition(node.cond, known)
        if isinstance(condition, bool):
            return self.value(node.iftrue if condition else node.iffalse, known)
        first = self.under(condition, lambda: self.value(node.iftrue, known))
        second = self.under(condition.negated(), lambda: self.value(node.iffalse, known))
        return self.merged(condition, first, second)

    def under(self, condition: Fact, evaluate: Callable[[], Any]) -> Any:
        """Evaluate on a path on which a condition holds."""
        self.prover.path.append(condition)
        try:
            return evaluate()
        finally:
            self.prover.path.pop()

    def merged(self, condition: Fact, first: Number, second: Number) -> Number:
        """Return the first number where a condition holds, the second elsewhere."""
        kind = first.kind if first.kind == second.kind else self.model.common(first.kind, second.kind)
        result = self.variable(min(first.low, second.low), max(first.high, second.high), "chosen")
        formula = z3.Or(
            z3.And(condition.formula, result.real == first.real),
            z3.And(z3.Not(condition.formula), result.real == second.real),
        )
        variables = condition.variables | first.variables | second.variables | {result}
        result.facts.append(Fact(formula, variables))
        return Number.of(result, kind)

    def condition(self, node: Any, known: Mapping[str, Number]) -> Fact | bool:
        """Return a condition as a formula, or whether it holds where the intervals say so."""
        match node:
            case c_ast.BinaryOp(op="||"):
                first, second = self.condition(node.left, known), self.condition(node.right, known)
                if isinstance(first, bool):
                    return first or second
                if isinstance(second, bool):
                    return second or first
                return Fact(z3.Or(first.formula, second.formula), first.variables | second.variables)
            case c_ast.BinaryOp(op="!=") if isinstance(node.left, c_ast.BinaryOp):
                first, second = self.condition(node.left, known), self.condition(node.right, known)
                if isinstance(first, bool) or isinstance(second, bool):
                    certain, other = (first, second) if isinstance(first, bool) else (second, first)
                    if isinstance(other, bool):
                        return certain != other
                    return other.negated() if certain else other
                return Fact(first.formula != second.formula, first.variables | second.variables)
            case c_ast.BinaryOp():
                return self._comparison(node.op, self.value(node.left, known), self.value(node.right, known))
        raise NotImplementedError(f"the condition in {self.place}")

    def _comparison(self, operator: str, left: Number, right: Number) -> Fact | bool:
        kind = self.model.common(left.kind, right.kind)
        left, right = self.converted(left, kind), self.converted(right, kind)
        formulas, certain, impossible = {
            "<": (left.real < right.real, left.high < right.low, left.low >= right.high),
            ">": (left.real > right.real, left.low > right.high, left.high <= right.low),
            ">=": (left.real >= right.real, left.low >= right.high, left.high < right.low),
            "<=": (left.real <= right.real, left.high <= right.low, left.low > right.high),
        }[operator]
        if certain or impossible:
            return bool(certain)
        return Fact(formulas, left.variables | right.variables)


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
