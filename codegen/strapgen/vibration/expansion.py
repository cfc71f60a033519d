"""Kernels to second order: what they compute of small inputs, in exact numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import sympy as sp
from sympy.polys.constructor import construct_domain

from strapgen.algebra import Direction, Wrapped
from strapgen.exceptions import InputError
from strapgen.kernel import Kernel, Stage
from strapgen.lowering.irrational import rationalized
from strapgen.program import RESOLUTION

#: An exact number: an element of a field of SymPy.
Number = Any
#: Names of two inputs, in the order of the alphabet.
Pair = tuple[str, str]


@dataclass(frozen=True)
class Expansion:
    """A polynomial of second degree in named inputs: what is left of a function where they are small.

    Parameters
    ----------
    constant : number
    linear : dict of str to number
        Coefficients of the inputs.
    square : dict of (str, str) to number
        Coefficients of products of two inputs, each product once.
    """

    constant: Number
    linear: dict[str, Number] = field(default_factory=dict)
    square: dict[Pair, Number] = field(default_factory=dict)

    def __add__(self, other: Expansion) -> Expansion:
        return Expansion(
            self.constant + other.constant,
            _sum(self.linear, other.linear),
            _sum(self.square, other.square),
        )

    def __mul__(self, other: Expansion) -> Expansion:
        if not other.linear and not other.square:
            return self.scaled(other.constant)
        if not self.linear and not self.square:
            return other.scaled(self.constant)
        products: dict[Pair, Number] = {}
        for a, left in self.linear.items():
            for b, right in other.linear.items():
                key = (a, b) if a <= b else (b, a)
                products[key] = products[key] + left * right if key in products else left * right
        mine, theirs = self.scaled(other.constant), other.scaled(self.constant)
        return Expansion(
            self.constant * other.constant,
            _sum(mine.linear, theirs.linear),
            _sum(products, _sum(mine.square, theirs.square)),
        )

    def scaled(self, factor: Number) -> Expansion:
        """Return this times a number."""
        if not factor:
            return Expansion(factor * self.constant)
        return Expansion(
            factor * self.constant,
            {a: factor * c for a, c in self.linear.items()},
            {pair: factor * c for pair, c in self.square.items()},
        )

    def without_constant(self) -> Expansion:
        """Return what depends on the inputs."""
        return Expansion(self.constant - self.constant, self.linear, self.square)


def _sum(left: Mapping[Any, Number], right: Mapping[Any, Number]) -> dict[Any, Number]:
    total = dict(left)
    for key, c in right.items():
        total[key] = total[key] + c if key in total else c
    return {key: c for key, c in total.items() if c}


@dataclass(frozen=True)
class Root:
    """The square root of what is zero without inputs: it has no expansion, its even functions have one."""

    square: Expansion


class Expander:
    """Evaluates kernels on expansions, in the smallest field that holds their numbers.

    Parameters
    ----------
    kernels : iterable of Kernel
        The kernels that will be evaluated.

    Examples
    --------
    >>> from strapgen import derive
    >>> expander = Expander([derive("coning-slow")])
    >>> inputs = {name: expander.variable(name) for name in ("beta_x", "coning_x")}
    >>> made = expander(derive("coning-slow"), inputs)["rotation_vector"]
    >>> {name: int(c) for name, c in made[0].linear.items()}, made[1].linear
    ({'beta_x': 1, 'coning_x': 1}, {})
    """

    def __init__(self, kernels: Iterable[Kernel]) -> None:
        self._kernels = {kernel.name: kernel for kernel in kernels}
        numbers = [sp.S.Half]
        for kernel in self._kernels.values():
            for expression in _expressions(kernel):
                numbers += _irrational(expression)
        self.domain = sp.QQ
        if len(numbers) > 1:
            domain, _ = construct_domain(list(dict.fromkeys(numbers)), extension=True, field=True)
            if domain.is_QQ or domain.is_Algebraic:
                self.domain = domain
            else:  # not algebraic: so many digits that nobody sees the difference
                self._kernels = {name: rationalized(kernel) for name, kernel in self._kernels.items()}
        self._functions: dict[type, Callable[[list[Any]], Expansion]] = {
            sp.sinc: lambda given: self._even(given[0], (1, sp.Rational(-1, 6), sp.Rational(1, 120))),
            sp.cos: lambda given: self._even(given[0], (1, sp.Rational(-1, 2), sp.Rational(1, 24))),
            sp.sin: lambda given: self._odd("sin", given[0]),
            sp.asin: lambda given: self._odd("asin", given[0]),
            sp.atan2: self._angle,
            Direction: self._angle,
            Wrapped: lambda given: self._odd("Wrapped", given[0]),
            sp.Max: self._largest,
        }

    def number(self, value: Any) -> Number:
        """Return an exact number of SymPy as an element of the field."""
        return self.domain.from_sympy(sp.sympify(value))

    def constant(self, value: Any) -> Expansion:
        """Return a number as an expansion."""
        return Expansion(self.number(value))

    def variable(self, name: str, at: Any = 0) -> Expansion:
        """Return an input that departs a little from a number."""
        return Expansion(self.number(at), {name: self.domain.one})

    def __call__(self, kernel: Kernel, inputs: Mapping[str, Expansion]) -> dict[str, list[Expansion]]:
        """Return the outputs of a kernel, row-major; elements of inputs that are not given are zero.

        Raises
        ------
        InputError
            If the kernel has no expansion where its inputs are zero.
        """
        exact = self._kernels[kernel.name]
        known = {RESOLUTION: self.constant(0)}
        for signal in exact.inputs:
            known |= {name: inputs.get(name) or self.constant(0) for name in signal.elements}
        try:
            for stage in (*exact.stages, *exact.outputs):
                for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
                    known[name] = self._evaluate(expression, known)  # type: ignore[assignment]
        except InputError as error:
            raise InputError(f"kernel {kernel.name} has no expansion to second order: {error}") from None
        return {stage.signal.name: self._elements(stage, known) for stage in exact.outputs}

    def _elements(self, stage: Stage, known: Mapping[str, Any]) -> list[Expansion]:
        return [_plain(known[name], name) for name in stage.signal.elements]

    def _evaluate(self, expression: sp.Expr, known: Mapping[str, Any]) -> Expansion | Root:
        if expression.is_Symbol:
            value: Expansion | Root = known[expression.name]
            return value
        if expression.is_number:
            return self.constant(expression)
        if expression.is_Add:
            total = self.constant(0)
            for argument in expression.args:
                total = total + _plain(self._evaluate(argument, known), argument)
            return total
        if expression.is_Mul:
            return self._product([self._evaluate(argument, known) for argument in expression.args])
        if expression.is_Pow:
            return self._power(self._evaluate(expression.base, known), expression.exp)
        if isinstance(expression, sp.Piecewise):
            return self._piecewise(expression, known)
        function = self._functions.get(expression.func)
        if function is None:
            raise InputError(f"nothing is known of {expression.func.__name__}")
        return function([self._evaluate(argument, known) for argument in expression.args])

    def _product(self, factors: list[Expansion | Root]) -> Expansion | Root:
        plain = self.constant(1)
        roots: list[Root] = []
        for factor in factors:
            if isinstance(factor, Root):
                roots.append(factor)
            else:
                plain = plain * factor
        if not roots:
            return plain
        if len(roots) == 1 and not plain.linear and not plain.square:
            return Root(roots[0].square.scaled(plain.constant**2))
        raise InputError("a square root of what vanishes stands in a product")

    def _power(self, base: Expansion | Root, exponent: sp.Expr) -> Expansion | Root:
        if isinstance(base, Root):
            if exponent.is_Integer and exponent % 2 == 0:
                return self._power(base.square, exponent / 2)
            raise InputError(f"the power {exponent} of a square root of what vanishes")
        if exponent.is_Integer and exponent >= 0:
            total = self.constant(1)
            for _ in range(int(exponent)):
                total = total * base
            return total
        if not base.constant:
            if exponent == sp.S.Half and not base.linear:
                return Root(base)
            raise InputError(
                "a division by what vanishes" if exponent < 0 else f"the power {exponent} of what vanishes"
            )
        if exponent.is_Integer:
            at = base.constant ** int(exponent)
        elif (2 * exponent).is_Integer:
            at = self._square_root(base.constant) ** int(2 * exponent)
        else:
            raise InputError(f"the power {exponent}")
        # (c + x)^n = c^n (1 + n x/c + n (n - 1)/2 (x/c)^2)
        relative = base.without_constant().scaled(self.domain.one / base.constant)
        first, second = self.number(exponent), self.number(exponent * (exponent - 1) / 2)
        series = self.constant(1) + relative.scaled(first) + (relative * relative).scaled(second)
        return series.scaled(at)

    def _square_root(self, value: Number) -> Number:
        if self.domain.is_QQ and value > 0:
            over, under = math.isqrt(int(value.numerator)), math.isqrt(int(value.denominator))
            if over**2 == value.numerator and under**2 == value.denominator:
                return self.domain(over, under)
        elif value == self.domain.one:
            return value
        raise InputError(f"the square root of {value} is not rational")

    def _even(self, argument: Expansion | Root, coefficients: tuple[Any, ...]) -> Expansion:
        """Return a series in the square of an argument that vanishes."""
        square = argument.square if isinstance(argument, Root) else argument * argument
        if square.constant:
            raise InputError("a function of an angle that does not vanish")
        zeroth, first, second = map(self.number, coefficients)
        return Expansion(zeroth) + square.scaled(first) + (square * square).scaled(second)

    def _odd(self, name: str, argument: Expansion | Root) -> Expansion:
        """Return x - x^3/6 or the like: x alone to second order."""
        plain = _plain(argument, name)
        if plain.constant:
            raise InputError(f"{name} of an angle that does not vanish")
        return plain

    def _angle(self, given: list[Any]) -> Expansion:
        y, x = (_plain(argument, "atan2") for argument in given)
        if y.constant or _sign(self.domain, x.constant) <= 0:
            raise InputError("the direction of a vector that does not lie on the first axis")
        return y * _plain(self._power(x, sp.S.NegativeOne), "atan2")  # atan q = q - q^3/3

    def _largest(self, given: list[Any]) -> Expansion:
        best, *rest = (_plain(argument, "Max") for argument in given)
        for other in rest:
            sign = _sign(self.domain, other.constant - best.constant)
            if sign == 0 and other != best:
                raise InputError("Max changes from one argument to another where nothing moves")
            best = other if sign > 0 else best
        return best

    def _piecewise(self, expression: sp.Piecewise, known: Mapping[str, Any]) -> Expansion | Root:
        for value, condition in expression.args:
            if condition == sp.true:
                return self._evaluate(value, known)
            left, right = (_plain(self._evaluate(side, known), side) for side in condition.args)
            sign = _sign(self.domain, left.constant - right.constant)
            if sign == 0 and left != right:
                raise InputError(f"the case {condition} changes where nothing moves")
            if condition.func(sign, 0) == sp.true:
                return self._evaluate(value, known)
        raise InputError("no case holds")


def _sign(domain: Any, value: Number) -> int:
    number = sp.sympify(domain.to_sympy(value))
    return int(sp.sign(number))


def _plain(value: Expansion | Root, where: Any) -> Expansion:
    if isinstance(value, Root):
        raise InputError(f"the square root of what vanishes, in {where}")
    return value


def _expressions(kernel: Kernel) -> Iterable[sp.Expr]:
    return chain.from_iterable(stage.expressions for stage in (*kernel.stages, *kernel.outputs))


def _irrational(expression: sp.Expr) -> list[sp.Expr]:
    """Return the irrational numbers in an expression, each as a whole."""
    if expression.is_Rational or expression.is_Symbol:
        return []
    if isinstance(expression, sp.Expr) and expression.is_number:
        return [expression]
    return [number for argument in expression.args for number in _irrational(argument)]
