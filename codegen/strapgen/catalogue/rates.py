"""Rate extraction: the body rate from the angle increments of one step."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.catalogue.coefficients import Number


def extraction(increments: int, node: Number) -> list[sp.Expr]:
    """Return the weights of the increments in the body rate at a node of the step.

    The increments are differences of the integrated rate at equally spaced samples; the polynomial of
    degree `increments` through those samples is differentiated (thesis, chapter 3 A, for two increments).

    Parameters
    ----------
    increments : int
        Number of equally spaced increments d_1, ..., d_K in the step.
    node : Fraction or Expr
        Where the rate is wanted, in steps: 0 the beginning, 1 the end.

    Returns
    -------
    list of Expr
        Weights v with w(t + node h) = (v_1 d_1 + ... + v_K d_K) / h: rational where the node is.

    Examples
    --------
    >>> extraction(2, Fraction(0))
    [3, -1]
    >>> extraction(1, Fraction(1, 2))
    [1]
    """
    return [sp.sympify(_at(polynomial, node)) for polynomial in _weights(increments)]


@cache
def _weights(increments: int) -> tuple[tuple[Fraction, ...], ...]:
    """Return the weights of the increments as polynomials of the node, constant terms first.

    The angle up to sample k is the sum of the first k increments, so an increment's weight is the sum of the
    derivatives of Lagrange's polynomials of all samples behind it.
    """
    samples = [Fraction(k, increments) for k in range(increments + 1)]
    slopes = [_derivative(_lagrange(samples, k)) for k in range(increments + 1)]
    return tuple(
        tuple(sum(column, Fraction(0)) for column in zip(*slopes[k:], strict=True))
        for k in range(1, increments + 1)
    )


def _lagrange(samples: list[Fraction], own: int) -> list[Fraction]:
    """Return the polynomial that is 1 at one sample and 0 at the others."""
    polynomial = [Fraction(1)]
    for place, sample in enumerate(samples):
        if place != own:
            scale = 1 / (samples[own] - sample)
            shifted, here = [Fraction(0), *polynomial], [*polynomial, Fraction(0)]
            polynomial = [scale * (x - sample * y) for x, y in zip(shifted, here, strict=True)]
    return polynomial


def _derivative(polynomial: list[Fraction]) -> list[Fraction]:
    return [power * coefficient for power, coefficient in enumerate(polynomial)][1:]


def _at(polynomial: tuple[Fraction, ...], node: Number) -> Number:
    if isinstance(node, Fraction):
        return sum((coefficient * node**power for power, coefficient in enumerate(polynomial)), Fraction(0))
    terms = (sp.Rational(c.numerator, c.denominator) * node**power for power, c in enumerate(polynomial))
    return sp.expand(sp.Add(*terms))
