"""The polynomial through the increments, integrated exactly: the limit of every method that fits and iterates.

Functional iteration on Rodrigues parameters, rotation vectors or quaternions converges to this rotation.
"""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.methods import polynomial_rotation
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.samples import Samples
from strapgen.kernel.kernel import KernelBuilder

#: Increments of a step in a part that has a series of its own: with 16 terms in each, more terms or more parts change
#: the drift by less than 1e-4 of itself on a cone of 15 deg at a fifth of the sampling rate.
_INCREMENTS = 2


def method(order: int) -> Method:
    """Return the rotation of the polynomial through the samples; series end at the power `order` of time."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        return polynomial_rotation.rotation(build, kinematics, coefficients(samples), order, parts(samples))

    return Method(
        "fit-exact",
        "exact rotation of the polynomial through the increments",
        f"Y. Wu, G. Yan, arXiv:1901.03468 (2019), at the limit of the iteration; {polynomial_rotation.SOURCE}",
        order,
        transition,
        isometry=lambda count: True,
    )


def coefficients(samples: Samples) -> list[sp.Matrix]:
    """Add stages for the Legendre coefficients of the rate times the step, in rad."""
    return [
        samples.combination(
            f"legendre_{m}",
            samples.fit.legendre(m),
            f"Legendre coefficient {m} of the rate times the step",
        )
        for m in range(samples.fit.degree + 1)
    ]


def parts(samples: Samples) -> int:
    """Return the number of equal parts of a step, each with a series of its own."""
    assert samples.increments is not None, "rates are refused before"
    return -(-samples.increments // _INCREMENTS)
