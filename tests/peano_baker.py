"""The true rotation of a step as a power series in the step length, exactly, and what a kernel makes of it.

The solution of X' = A(t) X is the sum of nested integrals of A (Peano, Baker): nothing here comes from the methods
under test. Coefficients are rational, or of any exact field.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from math import factorial
from random import Random
from typing import Any

import numpy as np
import sympy as sp

from strapgen.kernel.kernel import Kernel

#: Coefficients of a rate, the constant one first: sum_k rate[k] t^k, each an array of three exact numbers.
Rate = Sequence[np.ndarray]


class Series:
    """A power series in the step length, known up to a power.

    Parameters
    ----------
    coefficients : mapping of int to number
        Exact coefficients by power.
    top : int
        The last power that is kept.
    """

    def __init__(self, coefficients: Mapping[int, Any], top: int) -> None:
        self.top = top
        self.coefficients = {n: c for n, c in coefficients.items() if n <= top and c}

    def _other(self, other: Any) -> Mapping[int, Any]:
        return other.coefficients if isinstance(other, Series) else {0: other}

    def __add__(self, other: Any) -> Series:
        total = dict(self.coefficients)
        for n, c in self._other(other).items():
            total[n] = total[n] + c if n in total else c
        return Series(total, self.top)

    def __mul__(self, other: Any) -> Series:
        total: dict[int, Any] = {}
        for n, a in self.coefficients.items():
            for m, b in self._other(other).items():
                if n + m <= self.top:
                    total[n + m] = total[n + m] + a * b if n + m in total else a * b
        return Series(total, self.top)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Series:
        return self * -1

    def __truediv__(self, whole: int) -> Series:
        return Series({n: c / whole for n, c in self.coefficients.items()}, self.top)

    def __sub__(self, other: Any) -> Series:
        return self + other * -1

    def __pow__(self, exponent: int) -> Series:
        result: Any = 1
        for _ in range(exponent):
            result = self * result
        return result

    def near_one(self, exponent: Fraction) -> Series:
        """Return a power of a series whose constant term is 1, of any rational exponent, by the binomial series."""
        rest = self + -1
        assert 0 not in rest.coefficients
        term = result = Series({0: Fraction(1)}, self.top)
        for k in range(1, self.top + 1):
            term = term * rest * ((exponent - k + 1) / k)
            result = result + term
        return result

    @property
    def lowest(self) -> int | None:
        """The lowest power; None if all that is known is 0."""
        return min(self.coefficients, default=None)


class _Root:
    """A multiple of the square root of a series without constant term: even functions of it are series again."""

    def __init__(self, square: Series) -> None:
        assert 0 not in square.coefficients
        self.square = square

    def __mul__(self, factor: Any) -> _Root:
        return _Root(self.square * (factor * factor))

    __rmul__ = __mul__

    def even(self, first: int) -> Any:
        """Return the cosine, for first 0, or sin(x)/x, for 1."""
        terms = (self.square**k / ((-1) ** k * factorial(2 * k + first)) for k in range(1, self.square.top))
        return sum(terms, Series({0: 1}, self.square.top))


def _value(expression: sp.Expr, known: Mapping[str, Any], field: Any) -> Any:
    if expression.is_Symbol:
        return known[expression.name]
    if expression.is_number:
        return (
            Fraction(int(expression.p), int(expression.q)) if field is None else field.from_sympy(expression)
        )
    values = [_value(argument, known, field) for argument in expression.args if argument != sp.Rational(1, 2)]
    if expression.is_Add or expression.is_Mul:
        values = [_value(argument, known, field) for argument in expression.args]
        result = values[0]
        for value in values[1:]:
            result = result + value if expression.is_Add else result * value
        return result
    if expression.is_Pow and expression.exp.is_negative:
        exponent = Fraction(int(expression.exp.p), int(expression.exp.q))
        return _value(expression.base, known, field).near_one(exponent)
    if expression.is_Pow:
        return _Root(values[0]) if expression.exp == sp.Rational(1, 2) else values[0] ** int(expression.exp)
    return values[0].even({sp.cos: 0, sp.sinc: 1}[expression.func])


def evaluated(kernel: Kernel, values: Mapping[str, Any], wanted: str, field: Any = None) -> list[Any]:
    """Return the elements of a stage or output of a kernel where its inputs are series.

    Parameters
    ----------
    kernel : Kernel
    values : mapping of str to Series
        A value for every element of the inputs that is needed.
    wanted : str
        Name of the stage.
    field : Domain, optional
        The field of the coefficients, by default the rational numbers as fractions.
    """
    known = dict(values)
    for stage in (*kernel.stages, *kernel.outputs):
        for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            known[name] = _value(expression, known, field)
        if stage.signal.name == wanted:
            zero = next(iter(values.values())) * 0
            return [zero + known[name] for name in stage.signal.elements]
    raise KeyError(wanted)


def generic_rate(degree: int, field: Any = None) -> Rate:
    """Return a polynomial rate with random rational vectors: what holds for it by chance holds next to never."""
    random = Random(1969)

    def number() -> Any:
        value = Fraction(random.randint(-9, 9) or 1, random.randint(2, 7))
        return value if field is None else field.from_sympy(sp.Rational(value.numerator, value.denominator))

    return [np.array([number() for _ in range(3)], object) for _ in range(degree + 1)]


def angle(rate: Rate, begin: Fraction, end: Fraction, top: int) -> list[Series]:
    """Return the integral of a rate between two times in steps: the angle increment of a gyro."""
    return [
        Series(
            {k + 1: c[axis] * (end ** (k + 1) - begin ** (k + 1)) / (k + 1) for k, c in enumerate(rate)}, top
        )
        for axis in range(3)
    ]


def increments(rate: Rate, count: int, previous: int, top: int) -> list[Series]:
    """Return the elements of the increments of a step that begins at time 0, and of those before it."""
    times = [Fraction(k, count) for k in range(-previous, count + 1)]
    return [element for begin, end in pairwise(times) for element in angle(rate, begin, end, top)]


def turns(rate: Rate, nodes: Iterable[Any], top: int) -> list[Series]:
    """Return the elements of the rates at nodes of the step, times the step length."""
    return [
        Series({k + 1: c[axis] * node**k for k, c in enumerate(rate)}, top)
        for node in nodes
        for axis in range(3)
    ]


def matrix(algorithm: str, w: Sequence[Any]) -> list[list[Any]]:
    """Return A of X' = A X for a rate: X is the state as a column, or the transposed matrix of direction cosines."""
    x, y, z = w
    if algorithm == "dcm":
        return [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    if algorithm == "euler":
        rows = [[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]]
    else:
        rows = [[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]]
    return [[element / 2 if isinstance(element, Series) else 0 for element in row] for row in rows]


def rotation(algorithm: str, turn: Sequence[Sequence[Any]], top: int) -> list[Series]:
    """Return the transition of a step as the sum of nested integrals.

    Parameters
    ----------
    algorithm : str
    turn : sequence of vectors of Series
        The rate times the step as a polynomial of time in steps, the constant coefficient first. Each is of the first
        power of the step length at least.
    top : int
        The last power of the step length that is kept.

    Returns
    -------
    list of Series
        The elements of the transition, in the order of the algorithm's state.
    """
    A = [np.array(matrix(algorithm, w), object) for w in turn]
    zero, one = Series({}, top), Series({0: 1}, top)
    if algorithm == "dcm":
        start = np.where(np.eye(3, dtype=bool), one, zero)
    else:
        start = np.array([one if k == {"euler": 3}.get(algorithm, 0) else zero for k in range(4)], object)
    total, nested = start, {0: start}  # the last integral, by powers of time
    for _ in range(top):
        integrated: dict[int, Any] = {}
        for n, X in nested.items():
            for k, a in enumerate(A):
                term = a @ X / (n + k + 1)
                integrated[n + k + 1] = integrated[n + k + 1] + term if n + k + 1 in integrated else term
        nested = {n: X for n, X in integrated.items() if any(x.coefficients for x in X.flat)}
        total = sum(nested.values(), total)
    return list((total.T if algorithm == "dcm" else total).flat)


def true_rotation(algorithm: str, rate: Rate, top: int) -> list[Series]:
    """Return the transition of a step that begins at time 0, for a rate that is a polynomial of time."""
    turn = [[Series({k + 1: x}, top) for x in c] for k, c in enumerate(rate)]
    return rotation(algorithm, turn, top)


def lowest_difference(found: Sequence[Series], true: Sequence[Series]) -> int | None:
    """Return the lowest power in which two lists of series differ; None if there is none."""
    powers = ((a - b).lowest for a, b in zip(found, true, strict=True))
    return min((power for power in powers if power is not None), default=None)


def local_error(kernel: Kernel, rate: Rate, top: int) -> int | None:
    """Return the lowest power of the step in the error of one step from increments, up to a power; None if none."""
    previous = kernel.attitude_step.previous
    samples = kernel.inputs[1]
    values = dict(
        zip(samples.elements, increments(rate, samples.shape[0] - previous, previous, top), strict=True)
    )
    algorithm = kernel.attitude_step.product.removesuffix("-product")
    found = evaluated(kernel, values, kernel.transition)
    return lowest_difference(found, true_rotation(algorithm, rate, top))
