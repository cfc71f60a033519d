"""The canonical form of an attitude step: the transition in the vectors and products in which it is shortest.

General code generators see scalars. A step is more: its transition turns with its inputs, so it is a sum of a
few vectors and cross products whose weights are polynomials in a few scalar products. That form is derived here
for any kernel with a transition, in every basis that the kernel suggests.
"""

from __future__ import annotations

from strapgen.kernel import Kernel
from strapgen.lowering.canonical.core import Core, decompose, extract, verify
from strapgen.lowering.canonical.decomposition import NotCovariantError
from strapgen.lowering.canonical.search import plans
from strapgen.lowering.canonical.vectors import independent
from strapgen.lowering.canonical.writing import Writer
from strapgen.program import Assignment

__all__ = ["Core", "extract_core", "forms", "verify"]

#: How many of the plans that look cheapest are written out.
_WRITTEN = 5


def extract_core(kernel: Kernel) -> Core | None:
    """Return the transition of a kernel as a function of vectors; None if it is no such function."""
    if kernel.transition is None:
        return None
    try:
        return extract(kernel)
    except NotCovariantError:
        return None


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
        if core.transition.shape == (3, 3):
            written.append(writer.matrix(elements))
        else:
            written.append(writer.quaternion({element[-1]: element for element in elements}))
    return written
