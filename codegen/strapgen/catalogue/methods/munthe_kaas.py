"""Runge-Kutta-Munthe-Kaas methods: a tableau applied to the rotation vector of the step, then its exponential."""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.methods.method import PHI, Method, exponential
from strapgen.catalogue.methods.runge_kutta import advance
from strapgen.catalogue.methods.samples import Samples
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import KernelBuilder


def method(order: int) -> Method:
    """Return the method of an order on the classical tableau `rk<order>`."""
    tableau = TABLEAUX[f"rk{order}"]
    nodes = tuple(dict.fromkeys(tableau.nodes))

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        end = advance(
            build,
            tableau,
            {node: samples.turn(node) for node in nodes},
            sp.zeros(3, 1),
            lambda phi, turn: bortz(phi, turn, order - 2),
            like=Signal.vector("phi", "phi"),
            origin="zero",
        )
        return build.stage(PHI, end)

    return exponential(
        f"munthe-kaas{order}",
        f"Runge-Kutta-Munthe-Kaas method of order {order}",
        "H. Munthe-Kaas, Appl. Numer. Math. 29 (1999) 115-127",
        order,
        rotation_vector,
        nodes=nodes,
    )


def bortz(phi: sp.Matrix, turn: sp.Matrix, products: int) -> sp.Matrix:
    """Return the derivative of the rotation vector by Bortz's equation, with so many nested cross products at most.

    The equation is dphi/dt = sum_k (-1)^k B_k/k! phi x (phi x ... w) with Bernoulli's numbers B_k, B_1 = -1/2, which
    begins w + phi x w/2 + phi x (phi x w)/12 (J. E. Bortz, IEEE Trans. Aerosp. Electron. Syst. 7 (1971) 61-66).
    """
    total, nested = turn, turn
    for k in range(1, products + 1):
        nested = cross(phi, nested)
        total += bortz_coefficient(k) * nested
    return total


def bortz_coefficient(products: int) -> sp.Rational:
    """Return the coefficient of a number of nested cross products in Bortz's equation."""
    # B_1 of SymPy is +1/2 or -1/2, depending on its release.
    if products == 1:
        return abs(sp.bernoulli(1))
    return sp.bernoulli(products) / sp.factorial(products)
