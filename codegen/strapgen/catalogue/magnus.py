"""Magnus series: the rotation vector of a step from integrals of the rate, and its exponential."""

from __future__ import annotations

import sympy as sp

from strapgen import algebra
from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.steps import Method, Samples
from strapgen.kernel import KernelBuilder
from strapgen.signal import Signal

SOURCE = "S. Blanes, F. Casas, J. A. Oteo, J. Ros, Phys. Rep. 470 (2009) 151-238, section 5.3"

#: Nodes of Gauss and Legendre by their number, for steps that are given rates.
_GAUSS = {
    1: (sp.Rational(1, 2),),
    2: (sp.Rational(1, 2) - sp.sqrt(3) / 6, sp.Rational(1, 2) + sp.sqrt(3) / 6),
    3: (sp.Rational(1, 2) - sp.sqrt(15) / 10, sp.Rational(1, 2), sp.Rational(1, 2) + sp.sqrt(15) / 10),
}


def method(order: int) -> Method:
    """Return the Magnus series of order 2, 4 or 6.

    It is exact to its order for any rate, and the transition is a rotation whatever the rate is.

    Parameters
    ----------
    order : int
    """

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        moments = [
            samples.combination(f"moment_{power}", samples.fit.moment(power), _MEANINGS[power])
            for power in range(order // 2)
        ]
        vector = moments[0]
        if order > 2:
            vector = build.stage(
                Signal.vector("phi", "phi", unit="rad", meaning="rotation vector of the step"),
                (_fourth if order == 4 else _sixth)(build, *moments),
            )
        return kinematics.exponential(vector)

    return Method(
        f"magnus{order}",
        f"Magnus series of order {order}",
        SOURCE,
        order,
        transition,
        nodes=_GAUSS[order // 2],
        isometry=True,
    )


_MEANINGS = (
    "integral of the rate over the step",
    "integral of the rate times t - 1/2, t in steps",
    "integral of the rate times (t - 1/2)^2, t in steps",
)


def _commutator(a: sp.Matrix, b: sp.Matrix) -> sp.Matrix:
    """Return [a, b] for dC/dt = C skew(w): the source has dY/dt = A Y, whose transpose reverses every commutator."""
    return algebra.cross(b, a)


def _fourth(build: KernelBuilder, b0: sp.Matrix, b1: sp.Matrix) -> sp.Matrix:
    return b0 - _commutator(b0, b1)


def _sixth(build: KernelBuilder, b0: sp.Matrix, b1: sp.Matrix, b2: sp.Matrix) -> sp.Matrix:
    def named(name: str, meaning: str, value: sp.Matrix) -> sp.Matrix:
        return build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), value)

    a1 = named("alpha_1", "rate at the middle of the step, times the step", sp.Rational(9, 4) * b0 - 15 * b2)
    a2 = named("alpha_2", "its first derivative, times the step squared", 12 * b1)
    a3 = named("alpha_3", "half of its second derivative, times the step cubed", 180 * b2 - 15 * b0)
    c1 = named("commutator_1", "[alpha_1, alpha_2]", _commutator(a1, a2))
    c2 = named("commutator_2", "-[alpha_1, 2 alpha_3 + commutator_1]/60", -_commutator(a1, 2 * a3 + c1) / 60)
    left = named("left", "left side of the last commutator", c1 - 20 * a1 - a3)
    return b0 + _commutator(left, a2 + c2) / 240
