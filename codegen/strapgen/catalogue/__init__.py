"""The catalogue: every algorithm by name.

The names are plain data, so that listing and checking them imports no computer algebra; a kernel's module is
loaded when it is derived.
"""

from __future__ import annotations

from strapgen.catalogue.choice import AnyAlgorithm, Choice, named, orthonormalizations, state_name
from strapgen.catalogue.choosing import choose, choose_step, standard
from strapgen.catalogue.derivation import companion, derive, enough, fit, nodes, rounding
from strapgen.catalogue.kernels.kernel_names import MOTIONS, TWO_SPEED, UPDATE_ORDERS
from strapgen.catalogue.methods.method_spec import MOST_BESIDE, MOST_INCREMENTS, Integrator
from strapgen.catalogue.names import (
    ALGORITHMS,
    INTEGRATORS,
    KERNELS,
    LAYOUT_KERNELS,
    METHODS,
    STANDARD_METHODS,
    VECTORS,
    StepVector,
    reserved,
)
from strapgen.ir.kernel_info import Recipe

__all__ = [
    "ALGORITHMS",
    "INTEGRATORS",
    "KERNELS",
    "LAYOUT_KERNELS",
    "METHODS",
    "MOST_BESIDE",
    "MOST_INCREMENTS",
    "MOTIONS",
    "STANDARD_METHODS",
    "TWO_SPEED",
    "UPDATE_ORDERS",
    "VECTORS",
    "AnyAlgorithm",
    "Choice",
    "Integrator",
    "Recipe",
    "StepVector",
    "choose",
    "choose_step",
    "companion",
    "derive",
    "enough",
    "fit",
    "named",
    "nodes",
    "orthonormalizations",
    "reserved",
    "rounding",
    "standard",
    "state_name",
]
