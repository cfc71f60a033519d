"""Small inputs of a kernel: sums of shifts of one oscillation, and expansions of kernels to second order."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.kernel import power_series
from strapgen.kernel.kernel import Kernel, rationalize
from strapgen.kernel.power_series import Powers

#: A time as whole multiples of the basic times.
Shift = tuple[int, ...]
Matrix = list[list[Any]]


@dataclass(frozen=True)
class Wave:
    """A sum of terms c exp(j omega t) with shifts t, divided by a power of exp(j omega T) - 1, where T is the cycle.

    >>> step = Wave((2,), {(2,): 1, (0,): -1})
    >>> step.summed().terms, step.conjugate().terms
    ({(0,): 1}, {(-2,): 1, (0,): -1})
    """

    #: The cycle as a shift
    cycle: Shift
    #: Real coefficients by shifts
    terms: dict[Shift, Any]
    #: The power in the denominator; the fraction is reduced
    poles: int = 0

    def __add__(self, other: Wave) -> Wave:
        poles = max(self.poles, other.poles)
        left, right = self._over(poles), other._over(poles)
        total = dict(left)
        for shift, c in right.items():
            total[shift] = total[shift] + c if shift in total else c
        return _reduce(self.cycle, total, poles)

    def __mul__(self, other: Wave) -> Wave:
        return _reduce(self.cycle, _product(self.terms, other.terms), self.poles + other.poles)

    def scaled(self, factor: Any) -> Wave:
        """Return the wave times a number."""
        terms = {shift: factor * c for shift, c in self.terms.items()} if factor else {}
        return Wave(self.cycle, terms, self.poles if factor else 0)

    def shifted(self, shift: Shift) -> Wave:
        """Return the wave, later by a shift."""
        return Wave(self.cycle, {_plus(other, shift): c for other, c in self.terms.items()}, self.poles)

    def conjugate(self) -> Wave:
        """Return the complex conjugate, in which 1/(z - 1) becomes -z/(z - 1) because |z| = 1."""
        turned = {_minus(shift): c * (-1) ** self.poles for shift, c in self.terms.items()}
        return Wave(self.cycle, turned, self.poles).shifted(_times(self.cycle, self.poles))

    def summed(self) -> Wave:
        """Return the wave divided by z - 1, which is its sum over all earlier cycles."""
        return _reduce(self.cycle, self.terms, self.poles + 1)

    def _over(self, poles: int) -> dict[Shift, Any]:
        terms, one = self.terms, (0,) * len(self.cycle)
        for _ in range(poles - self.poles):
            terms = _product(terms, {self.cycle: 1, one: -1})
        return terms


def _plus(left: Shift, right: Shift) -> Shift:
    return tuple(a + b for a, b in zip(left, right, strict=True))


def _times(shift: Shift, count: int) -> Shift:
    return tuple(a * count for a in shift)


def _minus(shift: Shift) -> Shift:
    return _times(shift, -1)


def _product(left: dict[Shift, Any], right: dict[Shift, Any]) -> dict[Shift, Any]:
    total: dict[Shift, Any] = {}
    for a, c in left.items():
        for b, d in right.items():
            shift = _plus(a, b)
            total[shift] = total[shift] + c * d if shift in total else c * d
    return {shift: c for shift, c in total.items() if c}


def _reduce(cycle: Shift, terms: dict[Shift, Any], poles: int) -> Wave:
    """Return the fraction in lowest terms: z - 1 is divided out as often as possible."""
    terms = {shift: c for shift, c in terms.items() if c}
    while poles:
        quotient = _quotient(cycle, terms)
        if quotient is None:
            break
        terms, poles = quotient, poles - 1
    return Wave(cycle, terms, poles if terms else 0)


def _quotient(cycle: Shift, terms: dict[Shift, Any]) -> dict[Shift, Any] | None:
    """Return terms divided by z - 1; None if there is a remainder.

    Shifts that differ by whole cycles form a chain, and the quotient at each is minus the sum of the terms up to it.
    """
    place = next(k for k, length in enumerate(cycle) if length)
    chains: dict[Shift, dict[int, Any]] = {}
    for shift, c in terms.items():
        cycles = shift[place] // cycle[place]
        chains.setdefault(_plus(shift, _times(cycle, -cycles)), {})[cycles] = c
    quotient: dict[Shift, Any] = {}
    for start, chain in chains.items():
        total = 0
        for k in range(min(chain), max(chain) + 1):
            total = total + chain.get(k, 0)
            if total:
                quotient[_plus(start, _times(cycle, k))] = -total
        if total:
            return None
    return quotient


def resolvent(matrix: Matrix, one: Any) -> tuple[list[Matrix], int, int] | None:
    """Return adj(z I - P) in powers of z, and the powers of z and of z - 1 in det(z I - P).

    The algorithm is that of Faddeev and Le Verrier. The result is None if P has other eigenvalues than 0 and 1.

    >>> from fractions import Fraction
    >>> memory = [[Fraction(1), Fraction(2)], [Fraction(0), Fraction(0)]]
    >>> powers, zeros, ones = resolvent(memory, Fraction(1))
    >>> [[[int(c) for c in row] for row in power] for power in powers], zeros, ones
    ([[[0, 2], [0, -1]], [[1, 0], [0, 1]]], 1, 1)
    """
    size = len(matrix)
    zero = one - one
    identity = [[one if i == k else zero for k in range(size)] for i in range(size)]
    adjugate, coefficients = [identity], [one]
    current = identity
    for k in range(1, size + 1):
        moved = _matrix_product(matrix, current, zero)
        trace = sum((moved[i][i] for i in range(size)), zero)
        coefficients.append(-trace / k)
        current = [
            [x + (coefficients[-1] if i == m else zero) for m, x in enumerate(row)]
            for i, row in enumerate(moved)
        ]
        adjugate.append(current)
    adjugate.pop()  # zero, by Cayley and Hamilton
    polynomial = list(reversed(coefficients))  # constant first
    zeros = next(k for k, c in enumerate(polynomial) if c)
    ones, rest = 0, polynomial[zeros:]
    while len(rest) > 1 and not sum(rest, zero):
        ones += 1
        quotient = []
        total = zero
        for c in rest[:0:-1]:  # division by z - 1, from the highest power
            total = total + c
            quotient.append(total)
        rest = list(reversed(quotient))
    if len(rest) > 1:
        return None
    return list(reversed(adjugate)), zeros, ones


def _matrix_product(left: Matrix, right: Matrix, zero: Any) -> Matrix:
    columns = list(zip(*right, strict=True))
    return [
        [sum((a * b for a, b in zip(row, column, strict=True) if a and b), zero) for column in columns]
        for row in left
    ]


def combine(cycle: Shift, parts: Sequence[tuple[Any, Wave]]) -> Wave:
    """Return the sum of waves, each multiplied by a number."""
    total = Wave(cycle, {})
    for factor, wave in parts:
        if factor:
            total = total + wave.scaled(factor)
    return total


def map_shifts(wave: Wave, change: Callable[[Any], Any]) -> list[tuple[Shift, Any]]:
    """Return the shifts in order, each with its coefficient after a change."""
    return [(shift, change(c)) for shift, c in sorted(wave.terms.items())]


#: An exact number: an element of a field of SymPy.
Number = Any
#: Names of two inputs, in alphabetical order.
Pair = tuple[str, str]
_ORDER = 2


class Expansion(NamedTuple):
    """A polynomial of second degree in named inputs, which approximates a function of small inputs."""

    constant: Number
    #: Coefficients of the inputs
    linear: dict[str, Number]
    #: Coefficients of products of two inputs, each product once
    square: dict[Pair, Number]


class Expander:
    """Evaluates kernels on series in the size of their inputs, in the smallest field that holds their numbers.

    >>> from strapgen import derive
    >>> expander = Expander([derive("coning-slow")])
    >>> inputs = {name: expander.variable(name) for name in ("beta_x", "coning_x")}
    >>> elements = map(expander.expansion, expander(derive("coning-slow"), inputs)["rotation_vector"])
    >>> [sorted(element.linear) for element in elements]
    [['beta_x', 'coning_x'], [], []]
    """

    def __init__(self, kernels: Iterable[Kernel]) -> None:
        self._kernels = {kernel.name: kernel for kernel in kernels}
        if any(_is_transcendental(expression) for expression in self._expressions()):
            # They are rounded to so many digits that the results do not differ.
            self._kernels = {name: rationalize(kernel) for name, kernel in self._kernels.items()}
        unknowns = [name for kernel in self._kernels.values() for name in kernel.unknowns]
        self.domain = power_series.field(self._expressions(), unknowns).get_field()
        signals = itertools.chain.from_iterable(kernel.inputs for kernel in self._kernels.values())
        self._names = sorted({name for signal in signals for name in signal.elements})
        self._ring = sp.ring(self._names, self.domain)[0]

    def _expressions(self) -> Iterable[sp.Expr]:
        for kernel in self._kernels.values():
            for stage in (*kernel.stages, *kernel.outputs):
                yield from stage.expressions

    def number(self, value: Any) -> Number:
        """Return an exact number of SymPy as an element of the field."""
        return self.domain.from_sympy(sp.sympify(value))

    def constant(self, value: Any) -> Powers:
        """Return a number as a series."""
        return power_series.constant(self._ring, value, _ORDER)

    def variable(self, name: str, at: Any = 0) -> Powers:
        """Return an input of a kernel as a series: a number plus a small variable."""
        small = self._ring.gens[self._names.index(name)]
        return Powers(self._ring, {0: self._ring(self.number(at)), 1: small}, _ORDER)

    def expansion(self, series: Powers) -> Expansion:
        """Return the coefficients of a series as an expansion."""
        parts = [series.parts.get(power, self._ring.zero) for power in range(_ORDER + 1)]
        coefficients: list[dict[tuple[str, ...], Number]] = []
        for part in parts:
            terms = {}
            for exponents, c in part.terms() if part else ():
                chosen = (
                    (name,) * count for name, count in zip(self._names, exponents, strict=True) if count
                )
                terms[tuple(itertools.chain.from_iterable(chosen))] = c
            coefficients.append(terms)
        constant, linear, square = coefficients
        return Expansion(
            constant.get((), self.domain.zero),
            {name: c for (name,), c in linear.items()},
            {(one, other): c for (one, other), c in square.items()},
        )

    def __call__(self, kernel: Kernel, inputs: Mapping[str, Powers]) -> dict[str, list[Powers]]:
        """Return the outputs of a kernel, row-major; missing elements of inputs are zero."""
        exact = self._kernels[kernel.name]
        names = itertools.chain.from_iterable(signal.elements for signal in exact.inputs)
        values = {name: inputs.get(name) or self.constant(0) for name in names}
        try:
            return power_series.outputs(exact, values, self._ring, _ORDER)
        except ArithmeticError as error:
            raise InputError(f"kernel {kernel.name} has no expansion to second order: {error}") from None


def _is_transcendental(expression: sp.Expr) -> bool:
    """Return whether an expression holds a number that is not known to be algebraic."""
    if expression.is_number:
        return expression.is_algebraic is not True
    return any(_is_transcendental(argument) for argument in expression.args)
