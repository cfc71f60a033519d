"""Runge-Kutta-Munthe-Kaas methods: Bortz's equation, the order, and the exact rotation at a constant rate."""

from __future__ import annotations

import pytest
import sympy as sp

from strapgen.catalogue.methods.runge_kutta import bortz

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long

X = sp.Symbol("x", positive=True)


def across(products: int) -> list[sp.Expr]:
    """Return Bortz's series where the rotation vector is x about z and the rate 1 about x."""
    return [sp.expand(e) for e in bortz(sp.Matrix([0, 0, X]), sp.Matrix([1, 0, 0]), products)]


def test_the_coefficients_of_bortz_are_bernoulli_s():
    # phi x w is x about y, phi x (phi x w) is -x^2 about x: each product has a power of its own.
    along, beside, none = across(4)
    assert none == 0
    found = [sp.Poly(beside, X).coeff_monomial(X), -sp.Poly(along, X).coeff_monomial(X**2)]
    found += [-sp.Poly(beside, X).coeff_monomial(X**3), sp.Poly(along, X).coeff_monomial(X**4)]
    assert found == [sp.Rational(1, 2), sp.Rational(1, 12), 0, -sp.Rational(1, 720)]
    # (-1)^k B_k/k! with B_1 = -1/2, which SymPy gives either sign by its release.
    numbers = [-sp.Rational(1, 2), *(sp.bernoulli(k) for k in (2, 3, 4))]
    assert found == [(-1) ** k * b / sp.factorial(k) for k, b in enumerate(numbers, 1)]


def test_the_series_is_that_of_bortz_s_closed_form():
    # w + phi x w/2 + (1 - (x/2) cot(x/2))/x^2 phi x (phi x w).
    along, beside, _ = across(10)
    closed = sp.series(X / 2 * sp.cot(X / 2), X, 0, 12).removeO()
    assert sp.expand(along - closed) == 0
    assert beside == X / 2


@pytest.mark.parametrize("products", [0, 1, 2])
def test_the_series_solves_the_equation_of_rotation(products):
    # The rotation vector p t + q t^2 turns at the rate w with dR/dt = R skew(w): its series has that derivative.
    t = sp.Symbol("t")
    p, q = sp.Matrix([1, 2, -1]) / 3, sp.Matrix([2, -1, 1]) / 5
    phi = p * t + q * t**2

    def skew(v: sp.Matrix) -> sp.Matrix:
        return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

    K, R, power = skew(phi), sp.eye(3), sp.eye(3)
    for n in range(1, 7):
        power = (power * K).applyfunc(sp.expand) / n
        R += power
    W = (R.T * R.diff(t)).applyfunc(sp.expand)  # skew(w) up to t^5
    w = sp.Matrix([W[2, 1], W[0, 2], W[1, 0]])
    left = (bortz(phi, w, products) - phi.diff(t)).applyfunc(sp.expand)
    lowest = min(min(m[0] for m in sp.Poly(e, t).monoms()) for e in left if e != 0)
    # Of p t + q t^2 the first product with its own derivative is t^2 p x q, every further one brings a power.
    assert lowest == products + 2 if products < 2 else lowest >= 5
