"""Truncated power series in a small quantity, and exact evaluation of kernels on them.

The small quantity is the length of a step or, in general, the size of the inputs. Coefficients are polynomials.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.polys.polyerrors import CoercionFailed

from strapgen.ir.program import RESOLUTION
from strapgen.kernel.algebra import Direction, Wrapped
from strapgen.kernel.kernel import Kernel, evaluate_stages

_NO_SERIES = "the square root of a series that begins with 0 is no series"


class Powers:
    """A power series whose coefficients are polynomials, cut off after the power `top`.

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
        if isinstance(other, _SeriesRoot):
            raise ArithmeticError(_NO_SERIES)
        return other if isinstance(other, Powers) else Powers(self.ring, {0: self.ring(other)}, self.top)

    def __add__(self, other: Any) -> Powers:
        total = dict(self.parts)
        for power, part in self._of(other).parts.items():
            total[power] = total[power] + part if power in total else part
        return Powers(self.ring, total, self.top)

    def __mul__(self, other: Any) -> Powers:
        if isinstance(other, _SeriesRoot):
            return NotImplemented
        if not isinstance(other, Powers):
            return self._scale(self.ring(other))
        if len(other.parts) == 1 and 0 in other.parts:
            return self._scale(other.parts[0])
        if len(self.parts) == 1 and 0 in self.parts:
            return other._scale(self.parts[0])
        total: dict[int, Any] = {}
        for n, a in self.parts.items():
            for m, b in other.parts.items():
                if n + m > self.top:
                    break
                total[n + m] = total[n + m] + a * b if n + m in total else a * b
        return Powers(self.ring, total, self.top)

    __radd__, __rmul__ = __add__, __mul__

    def _scale(self, factor: Any) -> Powers:
        if factor.is_ground:
            factor = factor.LC  # a number
        return Powers(self.ring, {power: part * factor for power, part in self.parts.items()}, self.top)

    def __neg__(self) -> Powers:
        return Powers(self.ring, {power: -part for power, part in self.parts.items()}, self.top)

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

    def equals(self, other: Any) -> bool:
        """Return whether another series has the same coefficients."""
        return isinstance(other, Powers) and not (self - other).parts

    @property
    def start(self) -> Any:
        """The coefficient of the power 0."""
        return self.parts.get(0, self.ring.zero)

    def inverse(self) -> Powers:
        """Return the reciprocal of a series that begins with a number other than 0."""
        start = self._number()
        if not start:
            raise ArithmeticError("a series that begins with 0 has no inverse")
        rest = self * (self.ring.domain.one / start) - 1
        geometric = self.composed([(-1) ** k for k in range(self.top + 1)], rest)
        reciprocal: Powers = geometric * (self.ring.domain.one / start)
        return reciprocal

    def root(self) -> Powers:
        """Return the square root of a series that begins with the square of a number of the field."""
        factor = _root_of(self.ring.domain, self._number())
        rest = self * (self.ring.domain.one / (factor * factor)) - 1
        coefficients = [sp.binomial(sp.Rational(1, 2), k) for k in range(self.top + 1)]
        root: Powers = self.composed(coefficients, rest) * factor
        return root

    def composed(self, coefficients: Sequence[Any], inner: Powers) -> Powers:
        """Return sum_k coefficients[k] inner^k for a series `inner` that begins with 0."""
        total, power = self._of(0), self._of(1)
        for coefficient in coefficients:
            if not power.parts:
                break
            total = total + power * self.ring.domain.convert(coefficient)
            power = power * inner
        return total

    def _number(self) -> Any:
        """Return the coefficient of the power 0 as an element of the field."""
        if not self.start.is_ground:
            raise ArithmeticError("a series that begins with a polynomial has neither inverse nor root")
        return self.start.LC if self.start else self.ring.domain.zero


@lru_cache(256)
def _root_of(domain: Any, number: Any) -> Any:
    start = domain.to_sympy(number)
    if start.free_symbols:
        raise ArithmeticError(f"a series that begins with the unknown {start} has no series as its root")
    try:
        factor = domain.from_sympy(sp.sqrt(start)) if start > 0 else None
    except CoercionFailed:
        factor = None
    if not factor:
        raise ArithmeticError(f"a series that begins with {start} has no series as its root")
    return factor


class _SeriesRoot:
    """The square root of a series that begins with 0: no power series, though its even functions are."""

    __slots__ = ("square",)

    def __init__(self, square: Powers) -> None:
        self.square = square

    def __add__(self, other: Any) -> _SeriesRoot:
        raise ArithmeticError(_NO_SERIES)

    __radd__ = __add__

    def __mul__(self, factor: Any) -> _SeriesRoot:
        if isinstance(factor, _SeriesRoot):
            raise ArithmeticError(_NO_SERIES)
        return _SeriesRoot(self.square * factor * factor)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Powers:
        if exponent % 2:
            raise ArithmeticError(f"an odd power of it: {_NO_SERIES}")
        return self.square ** (exponent // 2)


def constant(ring: Any, value: Any, top: int) -> Powers:
    """Return an exact number of SymPy in the field of a ring as a series."""
    return Powers(ring, {0: ring(ring.domain.from_sympy(sp.sympify(value)))}, top)


def field(expressions: Iterable[sp.Expr], unknowns: Sequence[str] = ()) -> Any:
    """Return the rationals, extended by the roots in expressions and, over that field, by the polynomials in unknowns.

    Where an expression divides by an unknown, these are quotients of polynomials.

    >>> a = sp.Symbol("a", real=True)
    >>> field([sp.Rational(1, 2)]), field([a / 2], ["a"]), field([1 / a], ["a"])
    (QQ, QQ[a], QQ(a))
    """
    expressions = [*expressions]
    roots = {
        root
        for expression in expressions
        for root in expression.atoms(sp.Pow)
        if root.is_number and not root.is_Rational
    }
    numbers = sp.QQ.algebraic_field(*sorted(roots, key=str)) if roots else sp.QQ
    if not unknowns:
        return numbers
    generators = [sp.Symbol(name, real=True) for name in unknowns]
    divided = {
        symbol for x in expressions for p in x.atoms(sp.Pow) if p.exp.is_negative for symbol in p.free_symbols
    }
    return numbers.frac_field(*generators) if divided & {*generators} else numbers[tuple(generators)]


def outputs(kernel: Kernel, values: Mapping[str, Powers], ring: Any, top: int) -> dict[str, list[Powers]]:
    """Return the elements of each output, row-major, of a kernel with a series for every element of its inputs.

    >>> from strapgen import derive
    >>> ring, x, y, z = sp.ring("x y z", sp.QQ)
    >>> update = derive("euler-update")
    >>> state = {name: constant(ring, int(k == 3), 3) for k, name in enumerate(update.inputs[0].elements)}
    >>> turn = {name: Powers(ring, {1: e}, 3) for name, e in zip(update.inputs[1].elements, (x, y, z))}
    >>> outputs(update, state | turn, ring, 3)["next"][2].parts
    {1: 1/2*z, 3: -1/48*x**2*z - 1/48*y**2*z - 1/48*z**3}
    """

    def number(value: Any) -> Powers:
        return constant(ring, value, top)

    unknowns = {name: number(sp.Symbol(name, real=True)) for name in kernel.unknowns}
    inputs = {RESOLUTION: number(0), **unknowns, **values}
    known = evaluate_stages((*kernel.stages, *kernel.outputs), inputs, number, function)
    results = {stage.signal.name: [known[name] for name in stage.signal.elements] for stage in kernel.outputs}
    if not all(isinstance(element, Powers) for elements in results.values() for element in elements):
        raise ArithmeticError(_NO_SERIES)
    return results


def function(expression: sp.Expr, arguments: list[Any]) -> Any:
    """Evaluate a function, power, maximum or condition of series, for `strapgen.kernel.algebra.evaluate`."""
    if isinstance(expression, sp.Pow):
        return _power(arguments[0], expression.exp)
    if isinstance(expression, sp.Max):
        return _largest(expression, arguments)
    if expression.is_Relational:
        return bool(expression.func(*_compare(expression, *arguments)))
    if not arguments:
        raise ArithmeticError(f"{expression} is no root of a polynomial")
    if expression.func in (sp.cos, sp.sinc):
        return _even(expression, arguments[0])
    if expression.func in (sp.sin, sp.asin, sp.atan2, Direction, Wrapped):
        if any(isinstance(argument, _SeriesRoot) for argument in arguments):
            raise ArithmeticError(f"{expression.func.__name__} of it: {_NO_SERIES}")
        if not arguments[0].start:
            return _odd(expression, *arguments)
    raise ArithmeticError(f"{expression.func.__name__} is no power series here")


def _power(base: Any, exponent: sp.Expr) -> Any:
    if exponent.is_Integer:
        return base ** int(exponent)
    if (2 * exponent).is_Integer and isinstance(base, Powers):
        root = base.root() if base.start else _SeriesRoot(base)
        return root if exponent == sp.S.Half else root ** int(2 * exponent)
    raise ArithmeticError(f"the power {exponent} is no power series here")


def _even(expression: sp.Expr, argument: Any) -> Powers:
    """Return a cosine, or sin(x)/x."""
    if not isinstance(argument, _SeriesRoot) and argument.start:
        raise ArithmeticError(f"{expression} is no series with rational coefficients")
    square = argument.square if isinstance(argument, _SeriesRoot) else argument * argument
    first = int(expression.func is sp.sinc)
    coefficients = [sp.Rational((-1) ** k, math.factorial(2 * k + first)) for k in range(square.top // 2 + 1)]
    even: Powers = square.composed(coefficients, square)
    return even


def _odd(expression: sp.Expr, angle: Powers, across: Powers | None = None) -> Powers:
    """Return an odd function of a small angle, or the direction of the vector (across, angle)."""
    if across is not None:
        if _begins(across) <= 0:
            raise ArithmeticError(
                f"{expression} is the direction of a vector that does not begin on the first axis"
            )
        angle = angle * across.inverse()
    coefficients: list[Any] = [1]
    powers = range(angle.top // 2 + 1)
    if expression.func is sp.sin:
        coefficients = [sp.Rational((-1) ** k, math.factorial(2 * k + 1)) for k in powers]
    elif expression.func is sp.asin:
        coefficients = [sp.Rational(math.comb(2 * k, k), 4**k * (2 * k + 1)) for k in powers]
    elif across is not None:
        coefficients = [sp.Rational((-1) ** k, 2 * k + 1) for k in powers]
    return angle * angle.composed(coefficients, angle * angle)


def _largest(expression: sp.Expr, arguments: list[Any]) -> Any:
    best, *rest = arguments
    for other in rest:
        mine, others = _compare(expression, best, other)
        best = other if others > mine else best
    return best


def _compare(expression: sp.Expr, left: Any, right: Any) -> tuple[Any, Any]:
    """Return the numbers that decide a comparison of two series: their coefficients of the power 0."""
    numbers = _begins(left), _begins(right)
    if (numbers[0] - numbers[1]).free_symbols:
        raise ArithmeticError(f"{expression} is decided by the unknown {numbers[0] - numbers[1]}")
    if numbers[0] == numbers[1] and not (isinstance(left, Powers) and left.equals(right)):
        raise ArithmeticError(f"{expression} is decided by a value at its very limit")
    return numbers


def _begins(value: Any) -> Any:
    """Return the coefficient of the power 0 as a number of SymPy."""
    return sp.S.Zero if isinstance(value, _SeriesRoot) else value.ring.domain.to_sympy(value._number())
