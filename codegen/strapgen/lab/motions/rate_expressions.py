"""Turns rates in SymPy expressions into operations on Taylor polynomials; refuses other functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
from mpmath import iv, mp

from strapgen.ir.exceptions import InputError

#: Digits in which numbers of an expression are written.
NUMBER_DIGITS = 60
#: Most operations of a rate.
MOST_OPERATIONS = 2000

#: Functions that an expression may hold, by the name of their class in SymPy.
FUNCTIONS = ("sin", "cos", "tan", "exp", "log")
_ALLOWED = f"exact numbers, t, + - * /, whole powers, sqrt, {', '.join(FUNCTIONS)}"
#: How far rounding in double precision may lower a bound, for some thousand operations.
SLACK = 1 + 1e-9

#: An operation on the values of those before it: its name, the numbers of its arguments, and a number.
Operation = tuple[str, tuple[int, ...], Any]


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


class UnboundedError(ArithmeticError):
    """A divisor, or the argument of a root or logarithm, may be zero or less in an interval."""


@dataclass(frozen=True)
class _Jet:
    """A Taylor polynomial."""

    #: The value itself, or all values over the interval
    value: Any
    #: Taylor coefficients, or bounds of their magnitudes over the interval
    coefficients: list[Any]


class Jets:
    """Arithmetic of Taylor polynomials."""

    def __init__(self, order: int, bounds: bool) -> None:
        self.order, self.bounds = order, bounds
        self.sign = 1 if bounds else -1
        self.context = iv if bounds else mp

    def number(self, value: Any) -> _Jet:
        """Return a constant."""
        number = iv.mpf([value - abs(value) * 2**-45, value + abs(value) * 2**-45]) if self.bounds else value
        return self.jet(number, [0] * self.order)

    def time(self, value: Any) -> _Jet:
        """Return the time, from its value at an instant or from its interval."""
        return self.jet(value, [1, *[0] * (self.order - 1)])

    def jet(self, value: Any, rest: Sequence[Any]) -> _Jet:
        """Return a jet from its value and its further coefficients."""
        return _Jet(value, [_largest(value) if self.bounds else value, *rest])

    def divisor(self, value: Any) -> Any:
        """Return the divisor of a quotient."""
        if not self.bounds:
            if value == 0:
                raise UnboundedError
            return value
        least = float(mpmath.mpf(abs(value).a))
        if least <= 0:
            raise UnboundedError
        return least

    def add(self, x: _Jet, y: _Jet) -> _Jet:
        """Return a sum."""
        rest = [a + b for a, b in zip(x.coefficients[1:], y.coefficients[1:], strict=True)]
        return self.jet(x.value + y.value, rest)

    def multiply(self, x: _Jet, y: _Jet) -> _Jet:
        """Return a product."""
        a, b = x.coefficients, y.coefficients
        rest = [_convolve(a, b, k, 0, k) for k in range(1, self.order + 1)]
        return self.jet(x.value * y.value, rest)

    def power(self, x: _Jet, exponent: int) -> _Jet:
        """Return a whole power."""
        if exponent < 0:
            return self.reciprocal(self.power(x, -exponent))
        result = self.number(mp.mpf(1))
        for digit in bin(exponent)[2:]:
            result = self.multiply(result, result)
            if digit == "1":
                result = self.multiply(result, x)
        return _Jet(x.value**exponent, result.coefficients) if exponent else result

    def reciprocal(self, x: _Jet) -> _Jet:
        """Return 1/x."""
        inverse = 1 / self.divisor(x.value)
        result = [inverse]
        for k in range(1, self.order + 1):
            result.append(self.sign * inverse * _convolve(result, x.coefficients, k, 0, k - 1))
        return self.jet(1 / x.value, result[1:])

    def root(self, x: _Jet) -> _Jet:
        """Return the square root."""
        self.require_positive(x.value)
        value = self.context.sqrt(x.value)
        half = 1 / (2 * self.divisor(value))
        result = [_largest(value) if self.bounds else value]
        for k in range(1, self.order + 1):
            inner = _convolve(result, result, k, 1, k - 1)
            result.append((x.coefficients[k] + self.sign * inner) * half)
        return self.jet(value, result[1:])

    def exp(self, x: _Jet) -> _Jet:
        """Return the exponential."""
        value = self.context.exp(x.value)
        result = [_largest(value) if self.bounds else value]
        slope = [j * c for j, c in enumerate(x.coefficients)]
        for k in range(1, self.order + 1):
            result.append(_convolve(slope, result, k, 1, k) / k)
        return self.jet(value, result[1:])

    def log(self, x: _Jet) -> _Jet:
        """Return the natural logarithm."""
        self.require_positive(x.value)
        inverse = 1 / self.divisor(x.value)
        result: list[Any] = [0]
        for k in range(1, self.order + 1):
            slope = [j * c for j, c in enumerate(result)]
            inner = _convolve(slope, x.coefficients, k, 1, k - 1) / k
            result.append((x.coefficients[k] + self.sign * inner) * inverse)
        return self.jet(self.context.log(x.value), result[1:])

    def sine_and_cosine(self, x: _Jet) -> tuple[_Jet, _Jet]:
        """Return the sine and the cosine."""
        values = self.context.sin(x.value), self.context.cos(x.value)
        sine, cosine = ([_largest(value) if self.bounds else value] for value in values)
        slope = [j * c for j, c in enumerate(x.coefficients)]
        for k in range(1, self.order + 1):
            sine.append(_convolve(slope, cosine, k, 1, k) / k)
            cosine.append(self.sign * _convolve(slope, sine, k, 1, k) / k)
        return self.jet(values[0], sine[1:]), self.jet(values[1], cosine[1:])

    def require_positive(self, value: Any) -> None:
        """Refuse an argument of a root or logarithm that is not above zero everywhere."""
        if (value.a if self.bounds else value) <= 0:
            raise UnboundedError

    def evaluated(self, operations: Sequence[Operation], time: Any) -> list[_Jet]:
        """Return the jets of all operations, each on those before it."""
        jets: list[_Jet] = []
        for name, places, number in operations:
            arguments = [jets[place] for place in places]
            if name == "time":
                jets.append(self.time(time))
            elif name == "number":
                jets.append(self.number(number))
            elif name in ("sin", "cos", "tan"):
                sine, cosine = self.sine_and_cosine(*arguments)
                tangent = name == "tan"
                jets.append(
                    self.multiply(sine, self.reciprocal(cosine))
                    if tangent
                    else sine
                    if name == "sin"
                    else cosine
                )
            elif name == "power":
                jets.append(self.power(arguments[0], number))
            else:
                jets.append(getattr(self, name)(*arguments))
        return jets


def _convolve(x: Sequence[Any], y: Sequence[Any], k: int, first: int, last: int) -> Any:
    """Return the sum of x_j y_(k - j) for j from the first to the last."""
    total = 0
    for a, b in zip(x[first : last + 1], y[k - last : k - first + 1][::-1], strict=True):
        if a and b:  # constants and the time have few coefficients
            total += a * b
    return total


def _largest(value: Any) -> float:
    """Return the largest magnitude in an interval."""
    return float(mpmath.mpf(abs(value).b)) * (1 + 2**-50)
