"""Derivatives of the stages of a kernel: along changes of its inputs, and of covariant functions of vectors.

`add_tangents` is the arithmetic of dual numbers a + b eps with eps^2 = 0: the part in eps of every stage.

A covariant function is a sum of tensors T_c(u), each times a polynomial P_c in the scalar products s_kj = u_k . u_j.
Its derivative along an element of u_k is the sum of P_c dT_c plus, for every j, that element of u_j times the tensor
H_kj = sum_c dP_c/ds_kj T_c, twice where j is k. The tensors H do not depend on the direction. The derivatives keep the
form of the function: few products, each written once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, dot, exact, skew
from strapgen.kernel.covariants import Covariant, Decomposition
from strapgen.kernel.kernel import KernelBuilder, Stage
from strapgen.kernel.polynomials import Polynomial


def add_tangents(
    build: KernelBuilder,
    stages: Iterable[Stage],
    changes: Mapping[sp.Symbol, sp.Expr],
    ending: str,
    unit: str,
) -> dict[sp.Symbol, sp.Expr]:
    """Add a stage for the derivative of every stage that changes, and return the derivatives of all symbols.

    `ending` ends the names of these stages; where a stage is an angle in rad, its change has the `unit`. A stage whose
    elements are among the `changes` keeps those.

    >>> from strapgen.ir.signals import Signal
    >>> build = KernelBuilder()
    >>> x, dx = build.scalar(Signal.scalar("x")), build.scalar(Signal.scalar("dx"))
    >>> square = build.value("square", x**2)
    >>> add_tangents(build, build.stages[:], {x: dx}, "change", "m/s")[square]
    square_change
    >>> build.stages[-1].expressions
    (2*dx*x,)
    """
    known = dict(changes)
    for stage in list(stages):
        elements = [sp.Symbol(name, real=True) for name in stage.signal.elements]
        if changes.keys() >= set(elements):
            continue
        expressions = [
            tangent(element, expression, known)
            for element, expression in zip(elements, stage.expressions, strict=True)
        ]
        if not any(expressions):
            continue
        if all(expression.is_Symbol or expression.is_number for expression in expressions):
            known |= dict(zip(elements, expressions, strict=True))
            continue
        signal = replace(
            stage.signal,
            name=f"{stage.signal.name}_{ending}",
            elements=tuple(_name_of(name, ending) for name in stage.signal.elements),
            unit=unit if stage.signal.unit == "rad" else stage.signal.unit,
            meaning=f"change of: {stage.signal.meaning}",
            bound=None,
            constraint="",
        )
        known |= dict(zip(elements, build.stage(signal, expressions), strict=True))
    return known


def tangent(element: sp.Symbol, expression: sp.Expr, changes: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return the change of an element by its expression and the changes of the symbols in it."""
    if expression.is_Pow and expression.exp == -sp.S.Half:  # no new root: a power of the element
        return -(element**3) / 2 * tangent(element, expression.base, changes)
    terms = [
        _partial(expression, symbol) * changes[symbol]
        for symbol in sorted(expression.free_symbols, key=str)
        if changes.get(symbol, 0) != 0
    ]
    return sp.Add(*terms)


@lru_cache(10_000)
def _partial(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return a partial derivative, cached: the changes along all inputs of a kernel share it."""
    return sp.diff(expression, symbol)


def _name_of(element: str, ending: str) -> str:
    """Return the name of an element's change: the axis stays last."""
    name, separator, axis = element.rpartition("_")
    return f"{name}_{ending}_{axis}" if separator and len(axis) == 1 else f"{element}_{ending}"


@dataclass(frozen=True)
class _Term:
    """A tensor times a polynomial in scalar products."""

    name: str  # ends the names of its stages
    weight: Polynomial
    written: Sequence[sp.Expr]  # elements of the tensor in the elements of the vectors
    named: Sequence[sp.Expr]  # the same in the symbols of stages, where there are such


# Derivatives of covariant functions of vectors, which keep their form: few products, each written once.
#
# A function is a sum of tensors T_c(u), each times a polynomial P_c in the scalar products s_kj = u_k . u_j. Its
# derivative along an element of u_k is the sum of P_c dT_c plus, for every j, that element of u_j times the tensor
# H_kj = sum_c dP_c/ds_kj T_c, twice where j is k. The tensors H do not depend on the direction.


class CovariantFunction:
    """A covariant quaternion, vector (a quaternion with scalar 0) or matrix, and its derivatives, as stages.

    >>> from strapgen.kernel.covariants import Frame
    >>> frame = Frame(1)
    >>> (x, y, z), = frame.vectors
    >>> square = x * x + y * y + z * z
    >>> build = KernelBuilder()
    >>> u = build.input(Signal.vector("u", "u"))
    >>> function = CovariantFunction(build, frame.quaternion([square * x, square * y, square * z], square), [u], "f_")
    >>> function.values()
    [f_product_0_0*u_x, f_product_0_0*u_y, f_product_0_0*u_z, f_product_0_0]
    >>> function.derivative(0, 0)
    [f_product_0_0 + 2*u_x**2, 2*u_x*u_y, 2*u_x*u_z, 2*u_x]
    """

    def __init__(
        self,
        build: KernelBuilder,
        decomposition: Decomposition,
        vectors: Sequence[sp.Matrix],
        label: str = "",
    ) -> None:
        self._build, self._vectors, self._label = build, list(vectors), label
        self._scalars: dict[tuple[int, ...], sp.Symbol] = {}
        self._crossed: dict[Covariant, sp.Matrix] = {}
        self._gradients: dict[tuple[int, int], list[sp.Expr]] = {}
        self._terms = list(self._terms_of(decomposition))
        self._weights = [self._value(f"weight_{term.name}", term.weight) for term in self._terms]

    def values(self) -> list[sp.Expr]:
        """Return the elements of the function: x, y, z, s of a quaternion, or a matrix row by row."""
        pairs = list(zip(self._weights, self._terms, strict=True))
        return [
            sp.Add(*(weight * term.named[k] for weight, term in pairs))
            for k in range(len(self._terms[0].written))
        ]

    def derivative(self, vector: int, axis: int) -> list[sp.Expr]:
        """Return the derivatives of all elements with respect to an element of a vector."""
        along = self._vectors[vector][axis]
        total = [sp.Integer(0)] * len(self._terms[0].written)
        for weight, term in zip(self._weights, self._terms, strict=True):
            total = [a + weight * sp.diff(x, along) for a, x in zip(total, term.written, strict=True)]
        for other, element in enumerate(self._vectors):
            factor = 2 if other == vector else 1
            gradient = self._gradient(min(vector, other), max(vector, other))
            total = [a + factor * element[axis] * h for a, h in zip(total, gradient, strict=True)]
        return total

    def _terms_of(self, decomposition: Decomposition) -> list[_Term]:
        size = 4 if decomposition.scalar is not None else 9
        terms = []
        for covariant, weight in decomposition.vector.items():
            written, named = self._vector(covariant), self._named_vector(covariant)
            if size == 9:
                terms.append(self._term(covariant, weight, list(skew(written)), list(skew(named))))
            else:
                terms.append(self._term(covariant, weight, [*written, 0], [*named, 0]))
        if decomposition.scalar:
            unit = [sp.Integer(0)] * 3 + [sp.Integer(1)]
            terms.append(_Term("scalar", decomposition.scalar, unit, unit))
        for covariant, weight in decomposition.symmetric.items():
            written, named = (
                self._symmetric(covariant, which) for which in (self._vector, self._named_vector)
            )
            name = "_".join(map(str, ("symmetric", *covariant)))
            terms.append(_Term(name, weight, written, named))
        return terms

    @staticmethod
    def _term(
        covariant: Covariant, weight: Polynomial, written: list[sp.Expr], named: list[sp.Expr]
    ) -> _Term:
        return _Term("_".join(map(str, covariant)), weight, written, named)

    def _vector(self, covariant: Covariant) -> sp.Matrix:
        first, *rest = (self._vectors[k] for k in covariant)
        return cross(first, rest[0]) if rest else first

    def _named_vector(self, covariant: Covariant) -> sp.Matrix:
        """Return a vector, or the stage of a cross product."""
        if len(covariant) == 1:
            return self._vectors[covariant[0]]
        if covariant not in self._crossed:
            name = self._label + "cross_" + "_".join(map(str, covariant))
            meaning = f"cross product of vectors {covariant[0]} and {covariant[1]}"
            signal = Signal.vector(name, name, meaning=meaning)
            self._crossed[covariant] = self._build.stage(signal, self._vector(covariant))
        return self._crossed[covariant]

    def _symmetric(self, covariant: Covariant, which: object) -> list[sp.Expr]:
        """Return a symmetrized product of two vectors, or the unit matrix, row by row."""
        assert callable(which)
        if not covariant:
            return list(sp.eye(3))
        first, second = self._vectors[covariant[0]], which(covariant[1:])
        return list(first * second.T + second * first.T)

    def _gradient(self, k: int, j: int) -> list[sp.Expr]:
        """Return the tensor H_kj, each element a stage unless it is a constant or a symbol."""
        if (k, j) not in self._gradients:
            size = len(self._terms[0].written)
            total = [sp.Integer(0)] * size
            for term in self._terms:
                slope = self._polynomial(_slope(term.weight, (k, j)))
                total = [a + slope * x for a, x in zip(total, term.named, strict=True)]
            name = f"{self._label}gradient_{k}_{j}"
            symbols = []
            for place, expression in enumerate(total):
                if not (expression.is_number or expression.is_Symbol):
                    meaning = f"element {place} of the derivative by a scalar product"
                    expression = self._build.value(f"{name}_{place}", expression, meaning)
                symbols.append(expression)
            self._gradients[k, j] = symbols
        return self._gradients[k, j]

    def _value(self, name: str, polynomial: Polynomial) -> sp.Expr:
        """Name the value of a polynomial; a constant or a scalar product has no name of its own."""
        expression = self._polynomial(polynomial)
        if expression.is_number or expression.is_Symbol:
            return expression
        return self._build.value(self._label + name, expression, "weight of a vector or product")

    def _polynomial(self, polynomial: Polynomial) -> sp.Expr:
        return sp.Add(
            *(
                exact(c) * sp.Mul(*(self._scalar(factor) for factor in monomial))
                for monomial, c in polynomial.items()
            )
        )

    def _scalar(self, factor: tuple[int, ...]) -> sp.Symbol:
        if factor not in self._scalars:
            first, *rest = (self._vectors[k] for k in factor)
            if len(rest) > 1:
                raise NotImplementedError("a triple product is no scalar product")
            name = self._label + "product_" + "_".join(map(str, factor))
            meaning = f"scalar product of vectors {factor[0]} and {factor[1]}"
            self._scalars[factor] = self._build.value(name, dot(first, rest[0]), meaning)
        return self._scalars[factor]


def _slope(polynomial: Polynomial, factor: tuple[int, int]) -> Polynomial:
    """Return the derivative of a polynomial with respect to a scalar product."""
    slopes: dict[tuple[tuple[int, ...], ...], Fraction] = {}
    for monomial, c in polynomial.items():
        number = monomial.count(factor)
        if number:
            rest = list(monomial)
            rest.remove(factor)
            slopes[tuple(rest)] = slopes.get(tuple(rest), Fraction(0)) + c * number
    return slopes
