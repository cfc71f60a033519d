"""The names of the catalogue: listing and checking them needs no computer algebra."""

from __future__ import annotations

from functools import cache

from strapgen.catalogue.method_names import ALGORITHMS, VECTORS
from strapgen.ir.kernel_info import Recipe
from strapgen.registry import Registry

#: Kernels that take no method.
KERNELS = Registry("kernels", Recipe, lambda recipe: not getattr(recipe, "reader", ""))
#: Kernels of a description in a file.
LAYOUT_KERNELS = Registry("kernels", Recipe, lambda recipe: bool(getattr(recipe, "reader", "")))


@cache
def reserved() -> tuple[str, ...]:
    """Return the names that a user's algorithm cannot have, as they are at the first call."""
    return (*ALGORITHMS, *VECTORS, *KERNELS, *LAYOUT_KERNELS)
