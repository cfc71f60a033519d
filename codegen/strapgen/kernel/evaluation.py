"""Evaluation of expressions in any arithmetic (numbers, ring elements, intervals), and functions that SymPy lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import sympy as sp


def exact(number: Fraction | sp.Expr) -> sp.Expr:
    """Return a fraction as a number of SymPy, and any other exact number unchanged."""
    return sp.Rational(number.numerator, number.denominator) if isinstance(number, Fraction) else number


class Direction(sp.Function):  # type: ignore[misc]
    """The angle atan2(y, x) up to whole turns, so that -pi and pi are equivalent.

    Examples
    --------
    >>> Direction(0, -1)
    pi
    """

    nargs = 2

    @classmethod
    def eval(cls, y: sp.Expr, x: sp.Expr) -> sp.Expr | None:
        """Return the angle of two numbers; None for other arguments, which stay unevaluated."""
        return sp.atan2(y, x) if y.is_number and x.is_number else None


class Wrapped(sp.Function):  # type: ignore[misc]
    """An angle of at most one and a half turns, reduced to -pi to pi by a whole turn.

    Examples
    --------
    >>> Wrapped(3 * sp.pi / 2)
    -pi/2
    """

    nargs = 1

    @classmethod
    def eval(cls, angle: sp.Expr) -> sp.Expr | None:
        """Return the reduced angle of a number; None for other arguments, which stay unevaluated."""
        if not angle.is_number:
            return None
        turns = int(bool(angle > sp.pi)) - int(bool(angle < -sp.pi))
        return angle - 2 * sp.pi * turns


def evaluate(
    expression: sp.Expr,
    values: Mapping[str, Any],
    number: Callable[[sp.Rational], Any] | None = None,
    function: Callable[[sp.Expr, list[Any]], Any] | None = None,
) -> Any:
    """Evaluate an expression with the given values for its symbols.

    Unlike `subs` this does not rearrange the expression. It applies the operators of the values to each sum and
    product, so polynomials stay polynomials and numbers stay exact.

    Parameters
    ----------
    expression : Expr
    values : mapping of str to number, polynomial or Expr
    number : callable, optional
        Converts a rational number of SymPy if the values do not combine with it.
    function : callable, optional
        ``function(expression, arguments)`` evaluates an expression that is no sum, product or whole power, by default
        as SymPy does. It returns whether a condition holds, and then only one branch is evaluated.

    Returns
    -------
    number, polynomial or Expr

    Raises
    ------
    KeyError
        If a symbol has no value.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> evaluate(x * (x + y), {"x": 2, "y": 3})
    10
    """
    if expression.is_Symbol:
        return values[expression.name]
    if expression.is_Rational:
        return number(expression) if number else expression
    if function is not None and isinstance(expression, sp.Piecewise):
        # Branches are tried in order, since a later one may have no value here.
        for value, condition in expression.args:
            if condition == sp.true or evaluate(condition, values, number, function):
                return evaluate(value, values, number, function)
    arguments = [evaluate(argument, values, number, function) for argument in expression.args]
    if expression.is_Add or expression.is_Mul:
        result = arguments[0]
        for argument in arguments[1:]:
            # A polynomial must come first: a SymPy number on the left would treat it as a symbol.
            first, second = (argument, result) if isinstance(result, sp.Rational) else (result, argument)
            result = first + second if expression.is_Add else first * second
        return result
    if expression.is_Pow and expression.exp.is_Integer and expression.exp > 0:
        return arguments[0] ** int(expression.exp)
    if function is not None:
        return function(expression, arguments)
    return expression.func(*(sp.sympify(argument) for argument in arguments))
