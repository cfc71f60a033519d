"""Rate extraction: the body rate from the angle increments of one step."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp


def extraction(increments: int, node: Fraction) -> list[sp.Rational]:
    """Return the weights of the increments in the body rate at a node of the step.

    The increments are differences of the integrated rate at equally spaced samples; the polynomial of
    degree `increments` through those samples is differentiated (thesis, chapter 3 A, for two increments).

    Parameters
    ----------
    increments : int
        Number of equally spaced increments d_1, ..., d_K in the step.
    node : Fraction
        Where the rate is wanted, in steps: 0 the beginning, 1 the end.

    Returns
    -------
    list of Rational
        Weights v with w(t + node h) = (v_1 d_1 + ... + v_K d_K) / h.

    Examples
    --------
    >>> extraction(2, Fraction(0))
    [3, -1]
    >>> extraction(1, Fraction(1, 2))
    [1]
    """
    t = sp.Symbol("t")
    d = sp.symbols(f"d1:{increments + 1}")
    angles = [sum(d[:k], sp.Integer(0)) for k in range(increments + 1)]
    samples = [sp.Rational(k, increments) for k in range(increments + 1)]
    rate = sp.Poly(sp.interpolate(list(zip(samples, angles, strict=True)), t), t, *d).diff(t)
    at_node = sp.Poly(rate.eval(t, sp.Rational(node.numerator, node.denominator)), *d)
    return [at_node.coeff_monomial(symbol) for symbol in d]
