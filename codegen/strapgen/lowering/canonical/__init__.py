"""The canonical form of an attitude step: the transition in the vectors and products in which it is shortest.

General code generators see scalars. A step is more: its transition turns with its inputs, so it is a sum of a
few vectors and cross products whose weights are polynomials in a few scalar products. That form is derived here
for any kernel with a transition, in every basis that the kernel suggests.
"""

from __future__ import annotations

import math

from strapgen.kernel import Kernel
from strapgen.lowering.canonical.core import Core, decompose, extract, verify
from strapgen.lowering.canonical.decomposition import NotCovariantError
from strapgen.lowering.canonical.search import plans
from strapgen.lowering.canonical.vectors import independent
from strapgen.lowering.canonical.writing import NameClashError, Writer
from strapgen.program import Assignment

__all__ = ["Core", "expansion", "extract_core", "forms", "verify"]

#: How many of the plans that look cheapest are written out.
_WRITTEN = 5
#: Most terms of an expanded transition that has been seen to be shorter than its stages: in one or two vectors, the
#: degree 13 of an eighth-order method; in three or more, the degree 4 of a fourth-order one.
_MOST_TERMS = {"few": 320, "many": 120}


def extract_core(kernel: Kernel) -> Core | None:
    """Return the transition of a kernel as a polynomial of vectors; None if it is no such function."""
    if kernel.transition is None:
        return None
    try:
        core = extract(kernel)
        core.degree()
        return core
    except NotCovariantError:
        return None


def expansion(core: Core) -> str:
    """Tell why a transition should not be expanded; "" if it should.

    The number of terms is known beforehand: of n vectors there are n (n + 1) / 2 scalar products, and the terms are
    all products of these to the degree of the transition, with each vector and each cross product.

    Raises
    ------
    NotCovariantError
        If the transition is no polynomial.
    """
    vectors, degree = len(core.base()), core.degree()
    products = vectors * (vectors + 1) // 2

    def scalars(most: int) -> int:
        """Return the number of products of scalar products up to a degree in the vectors."""
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
    """Return code for a transition in canonical form, in several bases.

    Parameters
    ----------
    core : Core

    Returns
    -------
    list of list of Assignment
        Each assigns all elements of the transition; empty if the transition does not turn with its inputs.
    """
    try:
        found = plans(core, decompose(core))
    except NotCovariantError:
        return []
    base, elements = core.base(), core.transition.elements
    written = []
    for plan in found[:_WRITTEN]:
        vectors = plan.pool.vectors.values()
        writer = Writer(plan, [v.name for v in vectors if len(independent([*base, v.form])) == len(base)])
        try:
            if core.transition.shape == (3, 3):
                written.append(writer.matrix(elements))
            else:
                written.append(writer.quaternion({element[-1]: element for element in elements}))
        except NameClashError:  # another basis has other names, and the stages have their own
            continue
    return written
