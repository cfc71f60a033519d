"""The body rate over a step as a polynomial fitted to its samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import comb

import sympy as sp

from strapgen.kernel.algebra import exact

#: Coefficients of a polynomial of time, in steps from the beginning of the step, the constant one first.
Coefficients = tuple[sp.Expr, ...]


@dataclass(frozen=True)
class Fit:
    """The body rate times the step length as a polynomial of time that is linear in the samples.

    >>> fit = from_increments(2)
    >>> fit.at(Fraction(0)), fit.moment(0), fit.moment(1)
    ([3, -1], [1, 1], [-1/3, 1/3])
    """

    basis: tuple[Coefficients, ...]  # a polynomial for every sample, of the time from 0 to 1 over the step

    @property
    def degree(self) -> int:
        """Degree of the polynomial; of one that goes through the samples, one less than their number."""
        return len(self.basis[0]) - 1

    def at(self, node: Fraction | sp.Expr) -> list[sp.Expr]:
        """Return the weights of the samples in the rate at a node."""
        t = exact(node)
        powers = [t**k for k in range(self.degree + 1)]
        return [
            _reduce(sum((c * power for c, power in zip(row, powers, strict=True)), sp.Integer(0)))
            for row in self.basis
        ]

    def taylor(self, power: int, middle: sp.Rational = sp.S.Zero) -> list[sp.Expr]:
        """Return the weights of the samples in the coefficient of a power of time, in steps from `middle`.

        >>> from_increments(2).taylor(0), from_increments(2).taylor(0, sp.Rational(1, 2))
        ([3, -1], [1, 1])
        """
        factors = [comb(k, power) * middle ** (k - power) for k in range(power, self.degree + 1)]
        return [
            _reduce(sum((c * x for c, x in zip(row[power:], factors, strict=True)), sp.Integer(0)))
            for row in self.basis
        ]

    def legendre(self, degree: int) -> list[sp.Expr]:
        """Return the weights of the samples in the coefficient of a Legendre polynomial, see `legendre`.

        >>> from_increments(2).legendre(1)
        [-2, 2]
        """
        terms = [
            [(2 * degree + 1) * c * w for w in self.moment(power)]
            for power, c in enumerate(legendre(degree, sp.Rational(1, 2)))
            if c
        ]
        return [_reduce(sp.Add(*column)) for column in zip(*terms, strict=True)]

    def moment(self, power: int) -> list[sp.Expr]:
        """Return the weights of the samples in the integral over the step of the rate times (t - 1/2)^power."""
        half = sp.Rational(1, 2)
        expanded = [comb(power, j) * (-half) ** (power - j) for j in range(power + 1)]  # (t - 1/2)^power
        integrals = [
            sum((c / (k + j + 1) for j, c in enumerate(expanded)), sp.Integer(0))
            for k in range(self.degree + 1)
        ]
        return [
            _reduce(sum((c * x for c, x in zip(row, integrals, strict=True)), sp.Integer(0)))
            for row in self.basis
        ]

    def integral(self, begin: Fraction, end: Fraction) -> list[sp.Expr]:
        """Return the weights of the samples in the integral of the rate between two times, in steps.

        >>> from_increments(2).integral(Fraction(0), Fraction(1, 2))
        [1, 0]
        """
        ends = [exact(begin), exact(end)]
        powers = [(ends[1] ** (k + 1) - ends[0] ** (k + 1)) / (k + 1) for k in range(self.degree + 1)]
        return [_reduce(sp.Add(*(c * x for c, x in zip(row, powers, strict=True)))) for row in self.basis]

    def times_remaining(self) -> Fit:
        """Return the rate times 1 - t, the part of the step that is still to come at time t.

        >>> from_increments(1).times_remaining().basis
        ((1, -1),)
        """
        padded = [((*row, sp.Integer(0)), (sp.Integer(0), *row)) for row in self.basis]
        return Fit(tuple(tuple(a - b for a, b in zip(*pair, strict=True)) for pair in padded))


def from_legendre(filters: Sequence[Sequence[Fraction]]) -> Fit:
    """Return the rate whose Legendre coefficients, from degree 0 on, are given sums of the samples.

    >>> from_legendre([from_increments(2).legendre(m) for m in range(2)]) == from_increments(2)
    True
    """
    polynomials = [legendre(m) for m in range(len(filters))]
    basis = []
    for weights in zip(*filters, strict=True):
        column = [sp.Integer(0)] * len(filters)
        for weight, polynomial in zip(weights, polynomials, strict=True):
            for power, c in enumerate(polynomial):
                column[power] += exact(weight) * c
        basis.append(tuple(column))
    return Fit(tuple(basis))


def legendre(degree: int, middle: sp.Rational = sp.S.Zero) -> Coefficients:
    """Return the coefficients of a Legendre polynomial of the step in powers of time, in steps from `middle`.

    Over the step, from time 0 to 1, these polynomials are orthogonal to each other; each is 1 at its end.

    >>> legendre(2), legendre(2, sp.Rational(1, 2))
    ((1, -6, 6), (-1/2, 0, 6))
    """
    t = sp.Symbol("t")
    polynomial = sp.Poly(sp.legendre(degree, 2 * (t + middle) - 1), t)
    return tuple(reversed(polynomial.all_coeffs()))


@lru_cache(maxsize=64)
def from_increments(increments: int, previous: int = 0, ahead: int = 0) -> Fit:
    """Fit angle increments: the polynomial through the samples of the integrated rate, differentiated.

    Thesis, chapter 3 A, has it for two increments.
    """
    times = [sp.Rational(k, increments) for k in range(-previous, increments + ahead + 1)]
    cardinal = _lagrange(times)
    basis = []
    for first in range(1, len(times)):  # an increment raises the integral at every later sample
        column = [sum((c[k] for c in cardinal[first:]), sp.Integer(0)) for k in range(len(times))]
        basis.append(tuple(k * c for k, c in enumerate(column) if k))
    return Fit(tuple(basis))


def from_rates(nodes: Sequence[Fraction | sp.Expr]) -> Fit:
    """Fit rates at distinct nodes of the step."""
    return Fit(tuple(_lagrange([exact(node) for node in nodes])))


def step_order(increments: int, previous: int = 0, ahead: int = 0) -> int:
    """Return the highest order of a step whose only samples are increments.

    The fit of n = increments + previous + ahead increments errs by h^n e(t), where the integral of e over the step is
    zero: what is left is the commutator of e and the rate, whose first term is the integral of the sample polynomial
    prod (t - t_k), t_k the times of the samples, over the step. That integral is zero for an even number of
    increments with as many before the step as after it, as in Simpson's rule.

    >>> [step_order(count) for count in range(1, 9)]
    [2, 4, 4, 6, 6, 8, 8, 10]
    >>> step_order(1, previous=2), step_order(2, previous=1, ahead=1)
    (4, 6)
    """
    integral = [Fraction(1)]
    for k in range(-previous, increments + ahead + 1):
        time = Fraction(k, increments)
        shifted = [Fraction(0), *integral]
        integral = [a - time * b for a, b in zip(shifted, [*integral, Fraction(0)], strict=True)]
    total = sum((c / (k + 1) for k, c in enumerate(integral)), Fraction(0))
    return increments + previous + ahead + (1 if total else 2)


def _lagrange(nodes: list[sp.Expr]) -> list[Coefficients]:
    """Return the polynomials that are 1 at one of the nodes and 0 at the others."""
    polynomials = []
    for j, node in enumerate(nodes):
        coefficients: list[sp.Expr] = [sp.Integer(1)]
        for k, other in enumerate(nodes):
            if k != j:
                raised = [sp.Integer(0), *coefficients]
                padded = [*coefficients, sp.Integer(0)]
                coefficients = [
                    _reduce((a - other * b) / (node - other)) for a, b in zip(raised, padded, strict=True)
                ]
        polynomials.append(tuple(coefficients))
    return polynomials


def _reduce(number: sp.Expr) -> sp.Expr:
    return number if number.is_Rational else sp.radsimp(sp.expand(number))
