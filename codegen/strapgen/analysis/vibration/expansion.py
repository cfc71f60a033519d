"""Expands kernels to second order in small inputs, in exact numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any, NamedTuple

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.kernel import power_series
from strapgen.kernel.kernel import Kernel, rationalized
from strapgen.kernel.power_series import Powers

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
            self._kernels = {name: rationalized(kernel) for name, kernel in self._kernels.items()}
        unknowns = [name for kernel in self._kernels.values() for name in kernel.unknowns]
        self.domain = power_series.field(self._expressions(), unknowns).get_field()
        signals = chain.from_iterable(kernel.inputs for kernel in self._kernels.values())
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
                terms[tuple(chain.from_iterable(chosen))] = c
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
        names = chain.from_iterable(signal.elements for signal in exact.inputs)
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
