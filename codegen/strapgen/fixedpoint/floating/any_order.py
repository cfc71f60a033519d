"""Bounds the rounding of generated code whose operations a compiler may reorder, as ``-ffast-math`` allows.

Sums and products of a value are a sum of monomials in its inputs, literals, reciprocals and roots, and no association,
factoring or contraction changes these. Each passes through at most N roundings of relative size u, which the bound
takes from the operations of the source: the result is off by at most ((1 + u)^N - 1) times the sum of the magnitudes of
all monomials. A number near zero may be flushed to it on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.fixedpoint.floating.errors import (
    CONSTANT,
    INPUT,
    Expression,
    Expressions,
    NoBoundError,
    NumberFormat,
    least_magnitude,
)
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import up
from strapgen.ir.program import Constant, Operation, Program, walk

#: Roundings that a quotient or a root stands for: an approximation within 2 units of the last place, and a product.
_APPROXIMATED = 5
_ROUNDINGS = {"add": 1, "subtract": 1, "multiply": 1, "divide": _APPROXIMATED, "sqrt": _APPROXIMATED}
#: What has no bound in any order, in the words of a header.
_WITHOUT = {
    "sin": "sines",
    "cos": "cosines",
    "sinc": "sin(x)/x",
    "maximum": "comparisons",
    "select": "comparisons",
    "at_least": "comparisons",
}


@dataclass(frozen=True)
class _Monomials:
    """A value as a sum of monomials."""

    size: Fraction  # sum of their magnitudes
    excess: Fraction  # by which errors of reciprocals and roots enlarge that sum
    factors: (
        Fraction  # the same sum with every factor taken as 1 at least: what a flushed part is multiplied by
    )

    @classmethod
    def factor(cls, size: Fraction, excess: Fraction = Fraction(0)) -> _Monomials:
        """Return a value that is one factor."""
        return cls(size, excess, max(Fraction(1), size + excess))

    def __add__(self, other: _Monomials) -> _Monomials:
        return _Monomials(
            self.size + other.size, self.excess + other.excess, up(self.factors + other.factors)
        )

    def __mul__(self, other: _Monomials) -> _Monomials:
        excess = self.size * other.excess + self.excess * (other.size + other.excess)
        return _Monomials(up(self.size * other.size), up(excess), up(self.factors * other.factors))


class AnyOrder:
    """Bounds of all values of a program in any order of its operations; NoBoundError where there are none."""

    def __init__(
        self, program: Program, expressions: Expressions, ranges: Sequence[Interval], number: NumberFormat
    ) -> None:
        self._expressions, self._ranges, self._number = expressions, ranges, number
        nodes = [
            node
            for value in (*(a.value for a in program.body), *(n for r in program.results for n in r.nodes))
            for node in walk(value)
        ]
        rounded = sum(
            isinstance(node, Constant) and number.rounded(node.value) != node.value for node in nodes
        )
        kinds = [node.kind for node in nodes if isinstance(node, Operation)]
        self.roundings = rounded + sum(_ROUNDINGS.get(kind, 0) for kind in kinds)
        self.approximates = bool({"divide", "sqrt"} & set(kinds))
        share = self.roundings * number.unit
        if share > 1:
            raise NoBoundError("so many operations")
        self._relative = share + share * share  # at least (1 + u)^N - 1
        smallest = Fraction(2) ** (number.smallest + number.precision - 1)
        self._flushed = (
            (self.roundings + len(expressions.items)) * smallest if self.roundings else Fraction(0)
        )
        self._values: list[_Monomials] = []
        for place, expression in enumerate(expressions.items):
            self._values.append(self._monomials(place, expression))

    def error(self, place: int) -> Fraction:
        """Return a bound of the error of a value, which is 0 of a copy."""
        if self._expressions.items[place].kind == INPUT:
            return Fraction(0)
        value = self._values[place]
        if value.factors * (1 + self._relative) >= Fraction(2) ** (self._number.overflow - 1):
            raise NoBoundError("products that may overflow")
        enlarged = self._relative * (value.size + value.excess) + value.excess
        return up(enlarged + self._flushed * value.factors)

    def _monomials(self, place: int, expression: Expression) -> _Monomials:
        operands = [self._values[k] for k in expression.arguments]
        match expression.kind:
            case "input" | "constant":
                exact = expression.kind == CONSTANT
                return _Monomials.factor(abs(expression.value) if exact else self._ranges[place].magnitude)
            case "add" | "subtract":
                return operands[0] + operands[1]
            case "negate":
                return operands[0]
            case "multiply":
                return operands[0] * operands[1]
            case "divide":
                least, share = self._share(expression.arguments[1], "divisors near zero")
                inverse = up(1 / least)
                return operands[0] * _Monomials.factor(inverse, up(inverse * share / (1 - share)))
            case "sqrt":
                _, share = self._share(expression.arguments[0], "roots near zero")
                root = self._ranges[place].magnitude
                return _Monomials.factor(root, up(root * share))
        raise NoBoundError(_WITHOUT[expression.kind])

    def _share(self, place: int, what: str) -> tuple[Fraction, Fraction]:
        """Return the least magnitude of a divisor or a radicand, and its relative error."""
        least = least_magnitude(self._ranges[place])
        error = self.error(place)
        if 2 * error >= least:
            raise NoBoundError(what)
        return least, error / least
