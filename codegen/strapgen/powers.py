"""Power series in a small quantity, cut at a power: what kernels compute of them, exactly.

The small quantity is the length of a step, or the size of whatever is small; coefficients are polynomials.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.polys.polyerrors import CoercionFailed

from strapgen.algebra import Direction, Wrapped
from strapgen.kernel import Kernel, evaluate_stages
from strapgen.program import RESOLUTION

_NO_SERIES = "the square root of a series that begins with 0 is no series"


class Powers:
    """A power series in a small quantity.

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
        if isinstance(other, Root):
            raise ArithmeticError(_NO_SERIES)
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

    def equals(self, other: Any) -> bool:
        """Return whether all coefficients are those of another series."""
        return isinstance(other, Powers) and not (self - other).parts

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

    def __add__(self, other: Any) -> Root:
        raise ArithmeticError(_NO_SERIES)

    __radd__ = __add__

    def __mul__(self, factor: Any) -> Root:
        if isinstance(factor, Root):
            raise ArithmeticError(_NO_SERIES)
        return Root(self.square * factor * factor)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Powers:
        if exponent % 2:
            raise ArithmeticError(f"an odd power of it: {_NO_SERIES}")
        return self.square ** (exponent // 2)


def constant(ring: Any, value: Any, top: int) -> Powers:
    """Return a number of SymPy as a series."""
    return Powers(ring, {0: ring(ring.domain.from_sympy(sp.sympify(value)))}, top)


def field(expressions: Iterable[sp.Expr]) -> Any:
    """Return the field of the numbers in expressions: the rational ones, and what roots there are."""
    roots = {
        root
        for expression in expressions
        for root in expression.atoms(sp.Pow)
        if root.is_number and not root.is_Rational
    }
    return sp.QQ.algebraic_field(*sorted(roots, key=str)) if roots else sp.QQ


def outputs(kernel: Kernel, values: Mapping[str, Powers], ring: Any, top: int) -> dict[str, list[Powers]]:
    """Return what a kernel computes of series, by output.

    Parameters
    ----------
    kernel : Kernel
    values : mapping of str to Powers
        A series for every element of the inputs.
    ring : PolyRing
        Ring of the coefficients.
    top : int
        The last power that is kept.

    Raises
    ------
    ArithmeticError
        If an output is no power series.

    Examples
    --------
    >>> from strapgen import derive
    >>> ring, x, y, z = sp.ring("x y z", sp.QQ)
    >>> made = derive("euler-update")
    >>> begun = {name: constant(ring, int(k == 3), 3) for k, name in enumerate(made.inputs[0].elements)}
    >>> turned = {name: Powers(ring, {1: e}, 3) for name, e in zip(made.inputs[1].elements, (x, y, z))}
    >>> outputs(made, begun | turned, ring, 3)["next"][2].parts
    {1: 1/2*z, 3: -1/48*x**2*z - 1/48*y**2*z - 1/48*z**3}
    """

    def number(value: Any) -> Powers:
        return constant(ring, value, top)

    given = {RESOLUTION: number(0), **values}
    known = evaluate_stages((*kernel.stages, *kernel.outputs), given, number, function)
    found = {stage.signal.name: [known[name] for name in stage.signal.elements] for stage in kernel.outputs}
    if not all(isinstance(element, Powers) for elements in found.values() for element in elements):
        raise ArithmeticError(_NO_SERIES)
    return found


def function(expression: sp.Expr, arguments: list[Any]) -> Any:
    """Return a function of series, for `strapgen.algebra.evaluate`.

    Raises
    ------
    ArithmeticError
        If the result is no power series.
    """
    if isinstance(expression, sp.Pow):
        return _power(arguments[0], expression.exp)
    if isinstance(expression, sp.Max):
        return _largest(expression, arguments)
    if expression.is_Relational:
        return bool(expression.func(*_compared(expression, *arguments)))
    if not arguments:
        raise ArithmeticError(f"{expression} is no root of a polynomial")
    if expression.func in (sp.cos, sp.sinc):
        return _even(expression, arguments[0])
    if expression.func in (sp.sin, sp.asin, sp.atan2, Direction, Wrapped):
        if any(isinstance(argument, Root) for argument in arguments):
            raise ArithmeticError(f"{expression.func.__name__} of it: {_NO_SERIES}")
        if not arguments[0].start:
            return _odd(expression, *arguments)
    raise ArithmeticError(f"{expression.func.__name__} is no power series here")


def _power(base: Any, exponent: sp.Expr) -> Any:
    if exponent.is_Integer:
        return base ** int(exponent)
    if (2 * exponent).is_Integer and isinstance(base, Powers):
        root = base.root() if base.start else Root(base)
        return root if exponent == sp.S.Half else root ** int(2 * exponent)
    raise ArithmeticError(f"the power {exponent} is no power series here")


def _even(expression: sp.Expr, argument: Any) -> Powers:
    """Return a cosine, or sin(x)/x."""
    if not isinstance(argument, Root) and argument.start:
        raise ArithmeticError(f"{expression} is no series with rational coefficients")
    square = argument.square if isinstance(argument, Root) else argument * argument
    first = int(expression.func is sp.sinc)
    coefficients = [sp.Rational((-1) ** k, math.factorial(2 * k + first)) for k in range(square.top // 2 + 1)]
    made: Powers = square.composed(coefficients, square)
    return made


def _odd(expression: sp.Expr, angle: Powers, across: Powers | None = None) -> Powers:
    """Return an odd function of what is small, or the direction of what is nearly across."""
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
        mine, others = _compared(expression, best, other)
        best = other if others > mine else best
    return best


def _compared(expression: sp.Expr, left: Any, right: Any) -> tuple[Any, Any]:
    """Return the numbers by which two series are compared: those that they begin with."""
    numbers = _begins(left), _begins(right)
    if numbers[0] == numbers[1] and not (isinstance(left, Powers) and left.equals(right)):
        raise ArithmeticError(f"{expression} is decided by a value at its very limit")
    return numbers


def _begins(value: Any) -> Any:
    """Return the number that a series begins with, as SymPy's."""
    return sp.S.Zero if isinstance(value, Root) else value.ring.domain.to_sympy(value._number())
