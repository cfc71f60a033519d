"""Turns rates that are expressions of SymPy into operations on Taylor polynomials, and refuses what has none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpmath import mp

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.jets import FUNCTIONS, Operation

#: Digits in which numbers of an expression are written.
NUMBER_DIGITS = 60
#: Most operations of a rate.
MOST_OPERATIONS = 2000

_ALLOWED = f"exact numbers, t, + - * /, whole powers, sqrt, {', '.join(FUNCTIONS)}"


def rate_of(name: str, function: Any) -> tuple[Any, ...]:
    """Return the three expressions that a user's function returns, as functions of one symbol.

    `function`: ``function(t)`` takes a symbol of SymPy and returns three expressions in it, in rad/s.
    """
    import sympy as sp

    rate = function(time_symbol())
    try:
        elements = [sp.sympify(element) for element in (rate if not hasattr(rate, "tolist") else list(rate))]
    except (TypeError, ValueError, AttributeError):
        raise InputError(
            f"{name}: rate_expression returns {type(rate).__name__}; three expressions are needed"
        ) from None
    if len(elements) != 3 or not all(isinstance(element, sp.Expr) for element in elements):
        raise InputError(
            f"{name}: rate_expression returns {len(elements)} elements; three expressions are needed"
        )
    for axis, element in zip("xyz", elements, strict=True):
        others = sorted(str(symbol) for symbol in element.free_symbols - {time_symbol()})
        if others:
            raise InputError(f"{name}: the rate about {axis} holds {', '.join(others)}; t alone is allowed")
        if element.has(sp.Float):
            inexact = min(map(float, element.atoms(sp.Float)))
            raise InputError(
                f"{name}: the rate about {axis} holds the inexact number {inexact}; sympy.Rational writes it exactly"
            )
    return tuple(elements)


def time_symbol() -> Any:
    """Return the symbol of the time in s."""
    import sympy as sp

    return sp.Symbol("t", real=True)


def operations_of(name: str, rate: Sequence[Any]) -> tuple[list[Operation], list[int]]:
    """Return the operations that evaluate expressions, and the numbers of those that are the results."""
    writer = _OperationWriter(name)
    return writer.operations, [writer.place(element) for element in rate]


class _OperationWriter:
    """Writes expressions as operations, each of them once."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.operations: list[Operation] = []
        self.places: dict[Any, int] = {}

    def place(self, expression: Any) -> int:
        """Return the number of the operation whose result an expression is."""
        if expression not in self.places:
            self.places[expression] = self.written(expression)
        return self.places[expression]

    def add(self, operation: str, *places: int, number: Any = None) -> int:
        if len(self.operations) >= MOST_OPERATIONS:
            raise InputError(
                f"{self.name}: the rate has over {MOST_OPERATIONS} operations, which is the limit"
            )
        self.operations.append((operation, places, number))
        return len(self.operations) - 1

    def written(self, expression: Any) -> int:
        import sympy as sp

        if expression.is_number:
            if not expression.is_real or not expression.is_finite:
                raise InputError(
                    f"{self.name}: the rate holds {str(expression)[:60]}, which is no real number"
                )
            with mp.workdps(NUMBER_DIGITS):
                return self.add("number", number=mp.mpf(sp.N(expression, NUMBER_DIGITS)))
        if expression.is_Symbol:
            return self.add("time")
        if expression.is_Add or expression.is_Mul:
            operation = "add" if expression.is_Add else "multiply"
            first, *rest = (self.place(argument) for argument in expression.args)
            for other in rest:
                first = self.add(operation, first, other)
            return first
        if expression.is_Pow:
            return self.power(expression)
        if isinstance(expression, sp.sinc):
            raise self.refusal(expression)
        if type(expression).__name__ in FUNCTIONS:
            return self.add(
                type(expression).__name__, *(self.place(argument) for argument in expression.args)
            )
        raise self.refusal(expression)

    def power(self, expression: Any) -> int:
        import sympy as sp

        base, exponent = expression.args
        if base == sp.E:
            return self.add("exp", self.place(exponent))
        if exponent.is_Integer:
            return self.add("power", self.place(base), number=int(exponent))
        if (2 * exponent).is_Integer:
            return self.add("power", self.add("root", self.place(base)), number=int(2 * exponent))
        raise self.refusal(expression)

    def refusal(self, expression: Any) -> InputError:
        return InputError(f"{self.name}: the rate holds {str(expression)[:60]}; allowed are {_ALLOWED}")
