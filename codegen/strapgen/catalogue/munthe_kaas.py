"""Runge-Kutta-Munthe-Kaas methods: a tableau applied to the rotation vector of the step, and its exponential."""

from __future__ import annotations

import sympy as sp

from strapgen.algebra import cross
from strapgen.catalogue.runge_kutta import advance
from strapgen.catalogue.steps import PHI, Method, Samples, exponential
from strapgen.catalogue.tableaux import TABLEAUX
from strapgen.kernel import KernelBuilder
from strapgen.signal import Signal


def method(order: int) -> Method:
    """Return the method of order 4, on the classical tableau.

    Parameters
    ----------
    order : int
    """
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
    """Return the derivative of the rotation vector by Bortz's equation, as a series of cross products.

    dphi/dt = sum_k (-1)^k B_k/k! phi x (phi x ... w), B_k Bernoulli's numbers with B_1 = -1/2:
    w + phi x w/2 + phi x (phi x w)/12 + ... (J. E. Bortz, IEEE Trans. Aerosp. Electron. Syst. 7 (1971) 61-66).

    Parameters
    ----------
    phi : Matrix, 3 x 1
        Rotation vector in rad.
    turn : Matrix, 3 x 1
        Body rate, or body rate times the step.
    products : int
        How many cross products are kept.

    Returns
    -------
    Matrix, 3 x 1
    """
    total, nested = turn, turn
    for k in range(1, products + 1):
        nested = cross(phi, nested)
        total += bortz_coefficient(k) * nested
    return total


def bortz_coefficient(products: int) -> sp.Rational:
    """Return the coefficient of so many nested cross products in Bortz's equation, see `bortz`."""
    # SymPy's B_1 is +1/2 or -1/2 by its release; with its sign taken out it does not matter.
    if products == 1:
        return abs(sp.bernoulli(1))
    return sp.bernoulli(products) / sp.factorial(products)
