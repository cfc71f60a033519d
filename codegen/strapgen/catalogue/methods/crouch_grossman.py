"""Crouch-Grossman methods: a product of exponentials of the rate at the nodes, each times a weight and the step.

On attitude kinematics the rate does not depend on the attitude, so that nodes and weights are all that is left of the
tableau.
"""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.samples import Samples
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import KernelBuilder

SOURCE = (
    "P. E. Crouch, R. Grossman, J. Nonlinear Sci. 3 (1993) 1-33; coefficients as in E. Hairer, C. Lubich, G. Wanner, "
    "Geometric Numerical Integration, 2nd ed. (2006), IV.8"
)
#: Nodes and weights of the method of third order.
_NODES = (Fraction(0), Fraction(3, 4), Fraction(17, 24))
_WEIGHTS = (Fraction(13, 51), Fraction(-2, 3), Fraction(24, 17))


def method(order: int) -> Method:
    """Return the method of third order."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        total = None
        for number, (node, weight) in enumerate(zip(_NODES, _WEIGHTS, strict=True), 1):
            exponential = kinematics.exponential(exact(weight) * samples.turn(node))
            if total is not None:
                exponential = kinematics.product(total, exponential)
            if number == len(_NODES):
                return exponential
            elements = tuple(f"part{number}_{e.rsplit('_', 1)[1]}" for e in kinematics.transition.elements)
            signal = Signal(
                f"part{number}",
                kinematics.transition.shape,
                elements,
                meaning=f"product of the first {number} exponentials",
            )
            total = build.stage(signal, exponential)
        raise AssertionError("there are nodes")

    return Method(
        f"crouch-grossman{order}",
        f"Crouch-Grossman method of order {order}",
        SOURCE,
        order,
        transition,
        nodes=_NODES,
        isometry=lambda count: True,
    )
