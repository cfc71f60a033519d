"""Names of `strapgen.algebra`: rotations and functions of angles for users' kernels."""

from strapgen.kernel.evaluation import Direction, Wrapped, evaluate, exact
from strapgen.kernel.rotations import (
    CROSS,
    PAULI,
    adjugate,
    cayley_klein_matrix,
    cayley_klein_parameters,
    cross,
    cross_elements,
    dot,
    quaternion,
    quaternion_conjugate,
    quaternion_matrix,
    quaternion_product,
    rotation,
    skew,
    wave_series,
)

__all__ = [
    "CROSS",
    "PAULI",
    "Direction",
    "Wrapped",
    "adjugate",
    "cayley_klein_matrix",
    "cayley_klein_parameters",
    "cross",
    "cross_elements",
    "dot",
    "evaluate",
    "exact",
    "quaternion",
    "quaternion_conjugate",
    "quaternion_matrix",
    "quaternion_product",
    "rotation",
    "skew",
    "wave_series",
]
