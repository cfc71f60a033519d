"""The canonical form of an attitude step: the transition in the vectors and products in which it is shortest.

A general code generator works on scalars alone. The transition of a step commutes with rotations of its inputs, so it
is a sum of a few vectors and cross products whose weights are polynomials in a few scalar products. This package
derives that form for any kernel with a transition, in every basis that the kernel suggests.
"""

from __future__ import annotations

import math

from strapgen.ir.program import Assignment
from strapgen.kernel.covariants import NotCovariantError
from strapgen.kernel.kernel import Kernel
from strapgen.lowering.canonical.core import Core, decompose, extract, verify
from strapgen.lowering.canonical.plan import plans
from strapgen.lowering.canonical.vectors import independent
from strapgen.lowering.canonical.writing import write

__all__ = ["Core", "expansion", "extract_core", "forms", "verify"]

#: How many plans are written as code, those with the lowest estimates first.
_WRITTEN = 5
#: Most terms of an expanded transition that is worth while. In tests, expanding paid up to degree 13 in one or two
#: vectors (a method of eighth order), and up to degree 4 in three or more (a method of fourth order).
_MOST_TERMS = {"few": 320, "many": 120}


def extract_core(kernel: Kernel) -> Core | None:
    """Return the transition of a kernel as a polynomial of vectors; None if it is not one."""
    if kernel.transition is None:
        return None
    try:
        core = extract(kernel)
        core.degree()
        return core
    except NotCovariantError:
        return None


def expansion(core: Core) -> str:
    """Return the reason why a transition should not be expanded; "" if it should.

    The number of terms follows from the number n of vectors and the degree: n vectors have n (n + 1) / 2 scalar
    products, and the terms are all products of these up to the degree, with each vector and each cross product.
    """
    vectors, degree = len(core.base()), core.degree()
    products = vectors * (vectors + 1) // 2

    def scalars(most: int) -> int:
        """Return the number of monomials in the scalar products up to a degree in the vectors."""
        return math.comb(most // 2 + products, products) if most >= 0 else 0

    crosses = vectors * (vectors - 1) // 2
    terms = scalars(degree) + vectors * scalars(degree - 1) + crosses * scalars(degree - 2)
    if terms <= _MOST_TERMS["few" if vectors < 3 else "many"]:
        return ""
    return (
        f"The transition is a polynomial of degree {degree} in {vectors} vectors, up to {terms} terms if it is "
        "expanded; it is computed by its stages, which are as exact and shorter."
    )


def forms(core: Core) -> list[list[Assignment]]:
    """Return code for a transition in several bases; none if it does not commute with rotations of its inputs."""
    try:
        ranked = plans(core, decompose(core))
    except NotCovariantError:
        return []
    base = core.base()
    written = []
    for plan in ranked[:_WRITTEN]:
        offered = [
            v.name for v in plan.pool.vectors.values() if len(independent([*base, v.form])) == len(base)
        ]
        written.append(write(plan, offered, core.transition))
    return [form for form in written if form is not None]
