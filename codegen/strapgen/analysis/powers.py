"""Power series in the step length, cut at a power, with coefficients in a ring of polynomials."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.polys.polyerrors import CoercionFailed


class Powers:
    """A power series in the step length.

    Parameters
    ----------
    ring : PolyRing
        Ring of the coefficients.
    parts : mapping of int to ring element
        Coefficients by power; those beyond `top` are dropped.
    top : int
        The last power that is kept.

    Examples
    --------
    >>> ring, x = sp.ring("x", sp.QQ)
    >>> h = Powers(ring, {1: ring.one}, 3)
    >>> ((1 + h * x) ** 2).parts
    {0: 1, 1: 2*x, 2: x**2}
    """

    __slots__ = ("parts", "ring", "top")

    def __init__(self, ring: Any, parts: Mapping[int, Any], top: int) -> None:
        self.ring, self.top = ring, top
        self.parts = {power: part for power, part in sorted(parts.items()) if part and power <= top}

    def _of(self, other: Any) -> Powers:
        return other if isinstance(other, Powers) else Powers(self.ring, {0: self.ring(other)}, self.top)

    def __add__(self, other: Any) -> Powers:
        total = dict(self.parts)
        for power, part in self._of(other).parts.items():
            total[power] = total[power] + part if power in total else part
        return Powers(self.ring, total, self.top)

    def __mul__(self, other: Any) -> Powers:
        if isinstance(other, Root):
            return NotImplemented
        total: dict[int, Any] = {}
        for n, a in self.parts.items():
            for m, b in self._of(other).parts.items():
                if n + m > self.top:
                    break
                total[n + m] = total[n + m] + a * b if n + m in total else a * b
        return Powers(self.ring, total, self.top)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Powers:
        made: Powers = self * self.ring(-1)
        return made

    def __sub__(self, other: Any) -> Powers:
        return self + -self._of(other)

    def __rsub__(self, other: Any) -> Powers:
        return self._of(other) - self

    def __pow__(self, exponent: int) -> Powers:
        if exponent < 0:
            return self.inverse() ** -exponent
        result = self._of(1)
        for _ in range(exponent):
            result = result * self
        return result

    def __truediv__(self, other: Any) -> Powers:
        return self * self._of(other).inverse()

    def __rtruediv__(self, other: Any) -> Powers:
        return self._of(other) * self.inverse()

    @property
    def start(self) -> Any:
        """The coefficient of the power 0."""
        return self.parts.get(0, self.ring.zero)

    def inverse(self) -> Powers:
        """Return one over a series that begins with a number.

        Raises
        ------
        ArithmeticError
            If it begins with 0, or with what is no number.
        """
        start = self._number()
        if not start:
            raise ArithmeticError("a series that begins with 0 has no inverse")
        rest = self * (self.ring.domain.one / start) - 1
        made: Powers = self.composed([(-1) ** k for k in range(self.top + 1)], rest) * (
            self.ring.domain.one / start
        )
        return made

    def root(self) -> Powers:
        """Return the square root of a series that begins with the square of a number of the field.

        Raises
        ------
        ArithmeticError
            If it does not.
        """
        start = self.ring.domain.to_sympy(self._number())
        try:
            factor = self.ring.domain.from_sympy(sp.sqrt(start)) if start > 0 else None
        except CoercionFailed:
            factor = None
        if not factor:
            raise ArithmeticError(f"a series that begins with {start} has no series as its root")
        rest = self * (self.ring.domain.one / (factor * factor)) - 1
        coefficients = [sp.binomial(sp.Rational(1, 2), k) for k in range(self.top + 1)]
        made: Powers = self.composed(coefficients, rest) * factor
        return made

    def composed(self, coefficients: Sequence[Any], inner: Powers) -> Powers:
        """Return sum_k coefficients[k] inner^k for a series that begins with 0."""
        total, power = self._of(0), self._of(1)
        for coefficient in coefficients:
            if not power.parts:
                break
            total = total + power * self.ring.domain.convert(coefficient)
            power = power * inner
        return total

    def _number(self) -> Any:
        """Return the coefficient that the series begins with as an element of the field."""
        if not self.start.is_ground:
            raise ArithmeticError("a series that begins with a polynomial has neither inverse nor root")
        return self.start.LC if self.start else self.ring.domain.zero


class Root:
    """The square root of a series that begins with 0: no series itself, but even functions of it are."""

    __slots__ = ("square",)

    def __init__(self, square: Powers) -> None:
        self.square = square

    def __mul__(self, factor: Any) -> Root:
        return Root(self.square * factor * factor)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Powers:
        if exponent % 2:
            raise ArithmeticError("an odd power of the root of a series that begins with 0 is no series")
        return self.square ** (exponent // 2)


def function(expression: sp.Expr, arguments: list[Any]) -> Any:
    """Return a function of series, for `strapgen.algebra.evaluate`.

    Raises
    ------
    ArithmeticError
        If the result is no power series.
    """
    if expression in (sp.true, sp.false):
        return bool(expression)
    if isinstance(expression, sp.Pow):
        base, exponent = arguments[0], expression.exp
        if exponent == sp.Rational(1, 2):
            return base.root() if base.start else Root(base)
        if exponent == -sp.Rational(1, 2):
            return base.root().inverse()
        if exponent.is_Integer:
            return base ** int(exponent)
    if isinstance(expression, sp.Max):
        return max(arguments, key=_begins)
    if expression.is_Relational:
        left, right = map(_begins, arguments)
        if left == right:
            raise ArithmeticError(f"{expression} is decided by a value at its very limit")
        return bool(expression.func(left, right))
    if isinstance(expression, sp.Piecewise):
        return next(value for value, condition in arguments if condition)
    if type(expression).__name__ == "ExprCondPair":
        return tuple(arguments)
    (argument,) = arguments[:1]
    square = argument.square if isinstance(argument, Root) else None
    if expression.func in (sp.cos, sp.sinc):
        if square is None:
            if argument.start:
                raise ArithmeticError(f"{expression} is no series with rational coefficients")
            square = argument * argument
        first = 1 if expression.func is sp.sinc else 0
        coefficients = [
            sp.Rational((-1) ** k, math.factorial(2 * k + first)) for k in range(square.top // 2 + 1)
        ]
        return square.composed(coefficients, square)
    if expression.func is sp.sin and square is None and not argument.start:
        return argument * function(sp.sinc(expression.args[0]), [argument])
    raise ArithmeticError(f"{expression.func.__name__} is no power series here")


def _begins(value: Any) -> Any:
    """Return the number that a series begins with, as SymPy's."""
    if isinstance(value, Powers):
        return value.ring.domain.to_sympy(value._number())
    return sp.sympify(value)
