"""The rotation vector of a step as a sum of vectors and cross products of the rate's Legendre coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.methods import rotation_series
from strapgen.catalogue.methods.method import PHI
from strapgen.catalogue.methods.rotation_series import Scalars, Words
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, dot, exact
from strapgen.kernel.kernel import KernelBuilder


def rotation_vector(
    build: KernelBuilder, vectors: Sequence[sp.Matrix], terms: tuple[Scalars, Words, Words]
) -> sp.Matrix:
    """Add stages for the rotation vector to fourth order from Legendre coefficients of the rate times the step, in rad.

    The terms are the coefficients of the cross products of second order, and the words of third and of fourth order.
    """
    second = terms[0]
    third, fourth = rotation_series.third(terms[1]), rotation_series.fourth(terms[2])
    products: dict[tuple[int, int], sp.Symbol] = {}

    def weight(constant: Fraction, row: Scalars) -> sp.Expr:
        total = exact(constant)
        for (i, j), c in row.items():
            if (i, j) not in products:
                products[i, j] = build.value(
                    f"product_{i}_{j}",
                    dot(vectors[i], vectors[j]),
                    f"scalar product of Legendre coefficients {i} and {j}",
                )
            total += exact(c) * products[i, j]
        return total

    phi = sp.zeros(3, 1)
    for k in range(len(vectors)):
        value = weight(Fraction(int(k == 0)), third.get(k, {}))
        if value.is_Rational:
            phi += value * vectors[k]
        else:
            phi += build.value(f"weight_{k}", value, f"weight of Legendre coefficient {k}") * vectors[k]
    for k, m in sorted({*second, *fourth}):
        product = build.stage(
            Signal.vector(
                f"cross_{k}_{m}",
                f"cross_{k}_{m}",
                meaning=f"cross product of Legendre coefficients {k} and {m}",
            ),
            cross(vectors[k], vectors[m]),
        )
        value = weight(second.get((k, m), Fraction(0)), fourth.get((k, m), {}))
        if value.is_Rational:
            phi += value * product
        else:
            phi += build.value(f"weight_{k}_{m}", value, "weight of that cross product") * product
    return build.stage(PHI, phi)
