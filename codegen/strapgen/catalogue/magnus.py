"""Magnus series: the rotation vector of a step from integrals of the rate, and its exponential."""

from __future__ import annotations

import sympy as sp

from strapgen import algebra
from strapgen.catalogue.steps import PHI, Method, Samples, exponential
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

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        if order == 2:
            return _moment(samples, 0)
        return build.stage(PHI, (_fourth if order == 4 else _sixth)(build, samples))

    return exponential(
        f"magnus{order}",
        f"Magnus series of order {order}",
        SOURCE,
        order,
        rotation_vector,
        nodes=_GAUSS[order // 2],
    )


def _moment(samples: Samples, power: int) -> sp.Matrix:
    """Name the integral over the step of the rate times (t - 1/2)^power, t in steps."""
    meaning = (
        "integral of the rate over the step"
        if power == 0
        else "integral of the rate times t - 1/2, t in steps"
    )
    return samples.combination(f"moment_{power}", samples.fit.moment(power), meaning)


def _commutator(a: sp.Matrix, b: sp.Matrix) -> sp.Matrix:
    """Return [a, b] for dC/dt = C skew(w): the source has dY/dt = A Y, whose transpose reverses every commutator."""
    return algebra.cross(b, a)


def _fourth(build: KernelBuilder, samples: Samples) -> sp.Matrix:
    b0, b1 = _moment(samples, 0), _moment(samples, 1)
    return b0 - _commutator(b0, b1)


def _sixth(build: KernelBuilder, samples: Samples) -> sp.Matrix:
    def named(name: str, meaning: str, value: sp.Matrix) -> sp.Matrix:
        return build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), value)

    def alpha(number: int, meaning: str, *factors: sp.Expr) -> sp.Matrix:
        """Name a combination of the moments, which is one of the samples."""
        moments = [samples.fit.moment(power) for power in range(3)]
        weights = [
            sum((f * w for f, w in zip(factors, column, strict=True)), sp.S.Zero)
            for column in zip(*moments, strict=True)
        ]
        return samples.combination(f"alpha_{number}", [sp.radsimp(sp.expand(w)) for w in weights], meaning)

    b0 = _moment(samples, 0)
    a1 = alpha(
        1, "rate at the middle of the step, times the step", sp.Rational(9, 4), sp.S.Zero, sp.Integer(-15)
    )
    a2 = alpha(2, "its first derivative, times the step squared", sp.S.Zero, sp.Integer(12), sp.S.Zero)
    a3 = alpha(
        3, "half of its second derivative, times the step cubed", sp.Integer(-15), sp.S.Zero, sp.Integer(180)
    )
    c1 = named("commutator_1", "[alpha_1, alpha_2]", _commutator(a1, a2))
    c2 = named("commutator_2", "-[alpha_1, 2 alpha_3 + commutator_1]/60", -_commutator(a1, 2 * a3 + c1) / 60)
    left = named("left", "left side of the last commutator", c1 - 20 * a1 - a3)
    return b0 + _commutator(left, a2 + c2) / 240
