"""Matrices of a described filter: F, G and H by differentiation, transition and noise of a step, observability."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.polys.matrices import DomainMatrix

from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import DIGITS
from strapgen.navigation.kalman.kalman_file import FilterText

#: What the series of a constant transition may leave out, and the most terms of it.
_LEFT_OUT, _MOST_TERMS = 1e-30, 60
#: What covers the rounding of a bound in double.
_SPARE = 1e-9
#: Most states and symbols with which combinations are solved for in symbols, beyond which at general numbers.
_SYMBOLIC = 8, 4
#: Magnitude above which an eigenvalue does not decay: 1, less what computing it in 50 digits may add.
_UNIT = sp.Rational(10**20 - 1, 10**20)


@dataclass(frozen=True)
class Observability:
    """The rank of the observability matrix, and what no measurement shows."""

    #: Of H, H F, H F^2, ... over the rational functions of inputs and states
    rank: int
    #: Combinations of states that cannot be observed, as text
    unobservable: tuple[str, ...]


class Step(NamedTuple):
    """The discretization of a step; the noise is gamma diag(weights) gamma', positive semidefinite."""

    transition: sp.Matrix
    #: F^j T^j/j!, from the identity on
    terms: list[sp.Matrix]
    gamma: sp.Matrix
    weights: list[sp.Expr]


@dataclass(frozen=True)
class FilterModel:
    """The matrices of a filter, x' = f(x, u) + G w and z = h(x, u) + v.

    Entries are rational numbers, or expressions in the symbols of inputs and states.
    """

    text: FilterText

    def __post_init__(self) -> None:
        text = self.text
        derivatives = sp.Matrix([one.expression for one in text.states])
        for symbol in text.noise:
            if not derivatives.has(symbol):
                raise InputError(f"noise.{symbol} stands in no derivative; it drives nothing")
        for one in text.inputs:
            if not any(state.expression.has(one.symbol) for state in (*text.states, *text.measurements)):
                raise InputError(f"input[{one.name}] stands in no derivative and no measurement")
        for one in text.measurements:
            if not one.expression.free_symbols & set(self.x):
                raise InputError(f"measurement[{one.name}].expression holds no state")
        for row, one in enumerate(text.states):
            if self.G[row, :].free_symbols & set(text.noise):
                raise InputError(f"state[{one.name}].derivative does not hold the noise linearly")
        left = self.left_out
        if self.is_constant and (left is None or left > _LEFT_OUT):
            raise InputError(
                f"schedule.interval is {float(text.interval):g}; the series of its transition takes more than "
                f"{_MOST_TERMS} terms, and a shorter one is needed"
            )
        if text.kind != "online":
            self._require_constant()
        elif zero := [one.name for one in text.measurements if not one.deviation]:
            raise InputError(
                f"measurement[{zero[0]}].deviation is 0; above 0 is needed where the covariance is computed online, "
                "or its innovation can have no variance"
            )

    def _require_constant(self) -> None:
        for kind, rows, matrix in (
            ("state", self.text.states, (self.F, self.G)),
            ("measurement", self.text.measurements, (self.H,)),
        ):
            for place, one in enumerate(rows):
                names = sorted(str(s) for part in matrix for s in part[place, :].free_symbols)
                if names:
                    raise InputError(
                        f"{kind}[{one.name}]: its derivative by a state or a noise holds {names[0]}; with gains that "
                        f'are {self.text.kind} it is constant, and only kind = "online" takes others'
                    )

    @property
    def x(self) -> list[sp.Symbol]:
        """The symbols of the states."""
        return [one.symbol for one in self.text.states]

    @property
    def is_constant(self) -> bool:
        """Whether F and G hold neither inputs nor states."""
        return not (self.F.free_symbols or self.G.free_symbols)

    @cached_property
    def f(self) -> sp.Matrix:
        """The derivatives without noise."""
        return sp.Matrix([one.expression for one in self.text.states]).subs(dict.fromkeys(self.text.noise, 0))

    @cached_property
    def F(self) -> sp.Matrix:
        """Derivatives of f by the states."""
        return self.f.jacobian(self.x).as_immutable()

    @cached_property
    def G(self) -> sp.Matrix:
        """Factors of the noise, a column each."""
        derivatives = sp.Matrix([one.expression for one in self.text.states])
        if not self.text.noise:
            return sp.ImmutableMatrix.zeros(len(self.x), 0)
        return derivatives.jacobian(list(self.text.noise)).as_immutable()

    @cached_property
    def H(self) -> sp.Matrix:
        """Derivatives of the measurements by the states, a row each."""
        expressions = [one.expression for one in self.text.measurements]
        return sp.Matrix(expressions).jacobian(self.x).as_immutable()

    @cached_property
    def drift(self) -> sp.Matrix:
        """The part of f that does not depend on the states, where f is linear in them."""
        return (self.f - self.F * sp.Matrix(self.x)).applyfunc(sp.expand)

    @cached_property
    def order(self) -> int:
        """The highest power of the step in the series of the transition."""
        if not self.is_constant:
            return self.text.order
        power, size = self.F, 1
        while any(power) and size < _MOST_TERMS:
            if (left := self._left_out(size)) is not None and left < _LEFT_OUT:
                return size
            power, size = power * self.F if size < len(self.x) else power, size + 1
        return max(size - 1, 1)

    @cached_property
    def is_nilpotent(self) -> bool:
        """Whether the series of the transition ends, and nothing is left out."""
        return self.is_constant and not any(self.F ** (self.order + 1))

    @cached_property
    def left_out(self) -> float | None:
        """Bound of what the series of the transition leaves out, each state by its range; None where none is known.

        The initial deviation takes the place of a range that is not stated.
        """
        return 0.0 if self.is_nilpotent else self._left_out(self.order)

    def _left_out(self, order: int) -> float | None:
        if self._scaled is None or (norm := float(self._scaled.sum(axis=1).max())) >= order + 2:
            return None
        # Of a matrix without negative elements: the terms that follow are at most a geometric series.
        first = float(np.linalg.matrix_power(self._scaled, order + 1).sum(axis=1).max())
        return first / math.factorial(order + 1) / (1 - norm / (order + 2)) * (1 + _SPARE)

    @cached_property
    def _scaled(self) -> NDArray[np.float64] | None:
        """Bounds of the elements of F T, each state in units of its range; None where there are none."""
        scales = [one.range or one.deviation for one in self.text.states]
        sizes = [[self._magnitude(entry) for entry in self.F[row, :]] for row in range(len(scales))]
        if any(size is None for row in sizes for size in row):
            return None
        T = self.text.interval
        return np.array(
            [
                [
                    float((size or 0) * other / scale * T) * (1 + _SPARE)
                    for size, other in zip(row, scales, strict=True)
                ]
                for row, scale in zip(sizes, scales, strict=True)
            ]
        )

    def _magnitude(self, entry: sp.Expr) -> Fraction | None:
        """Return a bound of a polynomial over the ranges of inputs and states; None where there is none."""
        ranges = {one.symbol: one.range for one in (*self.text.inputs, *self.text.states)}
        symbols = sorted(entry.free_symbols, key=str) or [sp.Dummy()]
        known = [ranges.get(symbol, Fraction(1)) for symbol in symbols]
        if not entry.is_polynomial(*symbols) or None in known:
            return None
        total = Fraction(0)
        for powers, c in sp.Poly(entry, *symbols).terms():
            total += abs(Fraction(c.p, c.q)) * math.prod(
                (x or 0) ** k for x, k in zip(known, powers, strict=True)
            )
        return total

    def discretized(self, F: sp.Matrix, G: sp.Matrix, named: Callable[[str, sp.Matrix], sp.Matrix]) -> Step:
        """Return the discretization of F and G; `named` returns a matrix on the way, by its label, to go on with.

        With M_j = F^j G T^j/j!, the noise is the sum of M_i S M_j' T/(i + j + 1): Hilbert's matrix, as L D L'.
        """
        T, unit = exact(self.text.interval), sp.eye(len(self.x))
        terms = [unit]
        for j in range(1, self.order + 1):
            terms.append(named(f"F{j}", multiply(terms[-1], F * T / j)))
        moments = [multiply(term, G) for term in terms[: self.order + self.is_constant]]
        size = len(moments)
        lower, diagonal = sp.Matrix(size, size, lambda i, j: sp.Rational(1, i + j + 1)).LDLdecomposition(
            False
        )
        columns, weights = [sp.zeros(len(self.x), 0)], []
        for k in range(size):
            block = sum((moments[i] * lower[i, k] for i in range(k, size)), sp.zeros(*G.shape))
            for column, density in enumerate(self.text.noise.values()):
                if density and any(block[:, column]):
                    columns.append(block[:, column])
                    weights.append(exact(density) * diagonal[k, k] * T)
        transition = named("Phi", sum(terms[1:], unit))
        return Step(transition, terms, named("Gamma", sp.Matrix.hstack(*columns)), weights)

    @cached_property
    def _step(self) -> Step:
        return self.discretized(self.F, self.G, lambda _, matrix: _rounded(matrix))

    @property
    def transition(self) -> sp.Matrix:
        """Phi, the sum of F^j T^j/j! to the order."""
        return self._step.transition.as_immutable()

    @cached_property
    def forcing(self) -> sp.Matrix:
        """The integral of a constant transition over a step, by which a constant drift moves the states."""
        T = exact(self.text.interval)
        return _rounded(
            sum((term * T / (j + 1) for j, term in enumerate(self._step.terms)), sp.zeros(len(self.x)))
        )

    @cached_property
    def Q(self) -> sp.Matrix:
        """Covariance of the noise of a step."""
        gamma, weights = self._step.gamma, self._step.weights
        Q = _rounded(multiply(gamma * sp.diag(*weights), gamma.T)) if weights else sp.zeros(len(self.x))
        if not self.is_constant:
            return Q.as_immutable()
        # What is below the part that the series leaves out is none.
        least = sp.Rational(1, 10**60)
        return sp.ImmutableMatrix(
            *Q.shape, lambda i, j: Q[i, j] if Q[i, j] ** 2 > least * Q[i, i] * Q[j, j] else 0
        )

    @cached_property
    def observability(self) -> Observability:
        """The rank of the observability matrix, and the combinations of states that no measurement shows.

        A full rank at general numbers of inputs and states is proved; combinations of few symbols are exact.
        """
        F, H, names = self.F, self.H, [one.name for one in self.text.states]
        parts = (*F, *H)
        symbols = sorted(F.free_symbols | H.free_symbols, key=str)
        calls = {
            call for part in parts for call in part.atoms(sp.Function, sp.Pow) if not call.is_polynomial()
        }
        general = random.Random(1)
        at = {
            one: sp.Rational(general.randint(-999, 999), 997) for one in [*sorted(calls, key=str), *symbols]
        }
        basis = unseen(F.xreplace(at), H.xreplace(at))
        if not basis or (len(names) <= _SYMBOLIC[0] and len(symbols) <= _SYMBOLIC[1] and not calls):
            texts = [combination(names, vector) for vector in (unseen(F, H) if basis else [])]
        else:
            held = [[name for name, part in zip(names, vector, strict=True) if part] for vector in basis]
            texts = (
                [", ".join([*some, "by inputs"]) for some in held]
                if symbols
                else [combination(names, vector) for vector in basis]
            )
        return Observability(len(names) - len(basis), tuple(texts))


def combination(names: Sequence[str], vector: Sequence[sp.Expr]) -> str:
    """Return a combination of changes of states as text.

    >>> combination(["north", "east", "down"], [sp.Integer(1), sp.Integer(0), sp.Rational(-1, 2)])
    'north 1, down -1/2'
    """
    texts = []
    for name, factor in zip(names, vector, strict=True):
        text = str(factor)
        if factor.is_Rational and len(text) > 12:
            text = f"{float(factor):.6g}"
        texts += [] if factor == 0 else [f"{name} {text}"]
    return ", ".join(texts)


def unseen(F: sp.Matrix, H: sp.Matrix) -> list[list[sp.Expr]]:
    """Return a basis of the states that H, H F, H F^2, ... annul, exactly."""
    symbols = sorted((F.free_symbols | H.free_symbols), key=str)
    domain = sp.QQ.frac_field(*symbols) if symbols else sp.QQ
    step, rows = (DomainMatrix.from_Matrix(part).convert_to(domain) for part in (F, H))
    rows, rank = rows.rref()[0], -1
    while (now := rows.rank()) > rank:
        rank, rows = now, rows[:now, :]
        rows = rows.vstack(rows * step).rref()[0]
    reduced = rows.nullspace().to_Matrix()
    return [_normalized(list(reduced[k, :])) for k in range(reduced.rows)]


def _normalized(vector: list[sp.Expr]) -> list[sp.Expr]:
    """Return a multiple whose largest or last known part is 1."""
    parts = [part for part in vector if part != 0]
    first = max(parts, key=abs) if all(part.is_number for part in parts) else parts[0]
    return [sp.cancel(part / first) for part in vector]


def lasting(transition: sp.Matrix, basis: Sequence[Sequence[sp.Expr]], above: bool = True) -> bool:
    """Return whether the transition of an invariant space has an eigenvalue of magnitude 1, or `above` that."""
    if not basis:
        return False
    space = sp.Matrix(basis).T
    restricted = (space.T * space).LUsolve(space.T * transition * space)
    polynomial = DomainMatrix.from_Matrix(restricted).to_field().charpoly()
    z = sp.Symbol("z")
    for factor, _ in sp.Poly(polynomial, z, domain=sp.QQ).sqf_list()[1]:
        for root in factor.nroots(n=50, maxsteps=500):
            size = sp.Abs(root)
            if size >= _UNIT and (above or size <= 2 - _UNIT):
                return True
    return False


def dot(left: Iterable[sp.Expr], right: Iterable[sp.Expr]) -> sp.Expr:
    """Return a scalar product, not multiplied out."""
    return sp.Add(*(a * b for a, b in zip(left, right, strict=True) if a != 0 and b != 0))


def multiply(left: sp.Matrix, right: sp.Matrix) -> sp.Matrix:
    """Return a product of matrices, not multiplied out."""
    return sp.Matrix(left.rows, right.cols, lambda i, j: dot(left[i, :], right[:, j]))


def _rounded(matrix: sp.Matrix) -> sp.Matrix:
    """Return a matrix whose numbers of more than twice as many digits are rounded to `DIGITS`."""
    return matrix.applyfunc(
        lambda x: sp.Rational(str(sp.N(x, DIGITS))) if x.is_Rational and len(str(x.q)) > 2 * DIGITS else x
    )
