"""The catalogue: every algorithm by name.

The names are plain data, so that listing and checking them imports no computer algebra; a kernel's module is
loaded when it is derived.
"""

from __future__ import annotations

from strapgen.catalogue.choice import Choice, increments, orthonormalizations, previous
from strapgen.catalogue.choosing import choose, choose_step, standard, with_constants
from strapgen.catalogue.derivation import companion, derive, enough, nodes, rounding
from strapgen.catalogue.loop_names import LOOPS
from strapgen.catalogue.method_names import (
    ALGORITHMS,
    INTEGRATORS,
    METHODS,
    STANDARD_METHODS,
    VECTORS,
    Integrator,
    StepVector,
)
from strapgen.catalogue.names import (
    COMPENSATION,
    KERNELS,
    LAYOUT_KERNELS,
    MOST_BESIDE,
    MOST_INCREMENTS,
    MOTIONS,
    RESERVED,
    RUN_MOTIONS,
    TWO_SPEED,
    UPDATE_ORDERS,
)
from strapgen.catalogue.navigation_names import NAVIGATION
from strapgen.catalogue.output_names import OUTPUTS, TWO_ROWS
from strapgen.catalogue.recipe import Recipe
from strapgen.catalogue.redundancy_names import REDUNDANCY

__all__ = [
    "ALGORITHMS",
    "COMPENSATION",
    "INTEGRATORS",
    "KERNELS",
    "LAYOUT_KERNELS",
    "LOOPS",
    "METHODS",
    "MOST_BESIDE",
    "MOST_INCREMENTS",
    "MOTIONS",
    "NAVIGATION",
    "OUTPUTS",
    "REDUNDANCY",
    "RESERVED",
    "RUN_MOTIONS",
    "STANDARD_METHODS",
    "TWO_ROWS",
    "TWO_SPEED",
    "UPDATE_ORDERS",
    "VECTORS",
    "Choice",
    "Integrator",
    "Recipe",
    "StepVector",
    "choose",
    "choose_step",
    "companion",
    "derive",
    "enough",
    "increments",
    "nodes",
    "orthonormalizations",
    "previous",
    "rounding",
    "standard",
    "with_constants",
]
