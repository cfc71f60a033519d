"""Magnus series: the rotation vector of a step from integrals of the rate, and its exponential.

The series of order 2 is the integral of the rate. The series of order 4 adds the complete term of second order in the
rate; that of order 6 adds the terms of third and fourth order up to the sixth power of the step. Coning drift is of
second order in the rate, so a step on more samples than its order needs gains from all of them.
"""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.methods.method import PHI, Method, exponential
from strapgen.catalogue.methods.samples import Samples
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import KernelBuilder

SOURCE = "S. Blanes, F. Casas, J. A. Oteo, J. Ros, Phys. Rep. 470 (2009) 151-238, section 5.3"

#: Gauss-Legendre nodes by their number, for steps that take rates.
_GAUSS = {
    1: (sp.Rational(1, 2),),
    2: (sp.Rational(1, 2) - sp.sqrt(3) / 6, sp.Rational(1, 2) + sp.sqrt(3) / 6),
    3: (sp.Rational(1, 2) - sp.sqrt(15) / 10, sp.Rational(1, 2), sp.Rational(1, 2) + sp.sqrt(15) / 10),
}


def method(order: int) -> Method:
    """Return the Magnus series of order 2, 4 or 6: exact to its order for any rate, and always a rotation."""

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
    """Add a stage for the integral over the step of the rate times (t - 1/2)^power, t in steps."""
    meaning = (
        "integral of the rate over the step"
        if power == 0
        else "integral of the rate times t - 1/2, t in steps"
    )
    return samples.combination(f"moment_{power}", samples.fit.moment(power), meaning)


def _legendre_moment(samples: Samples, degree: int) -> list[sp.Expr]:
    """Return the weights of the samples in the integral over the step of the rate times a Legendre polynomial."""
    return [weight / (2 * degree + 1) for weight in samples.fit.legendre(degree)]


def _second_order(samples: Samples, first: int) -> sp.Matrix:
    """Return the term of second order in the rate, for its Legendre polynomials from the even degree `first` on.

    With the integrals m_k of the rate times the Legendre polynomial P_k the term is half the sum of m_k x m_(k+1):
    the integral of P_k is a difference of P_(k+1) and P_(k-1), so that all other products vanish. Two products that
    share the vector of odd degree are taken as one, (m_(k-1) - m_(k+1)) x m_k.
    """
    total = sp.zeros(3, 1)
    for odd in range(first + 1, samples.fit.degree + 1, 2):
        below, above = _legendre_moment(samples, odd - 1), _legendre_moment(samples, odd + 1)
        polynomials, name = f"P{odd - 1}", f"moment_{odd - 1}"
        if any(above):
            polynomials, name = f"P{odd - 1} - P{odd + 1}", f"{name}_less_{odd + 1}"
        even = samples.combination(
            name,
            [a - b for a, b in zip(below, above, strict=True)],
            f"integral over the step of the rate times {polynomials}, Legendre polynomials",
        )
        half = samples.combination(
            f"half_moment_{odd}",
            [weight / 2 for weight in _legendre_moment(samples, odd)],
            f"half the integral over the step of the rate times P{odd}, a Legendre polynomial",
        )
        total -= _commutator(even, half)
    return total


def _commutator(a: sp.Matrix, b: sp.Matrix) -> sp.Matrix:
    """Return [a, b] for dC/dt = C skew(w): the source has dY/dt = A Y, whose transpose reverses every commutator."""
    return algebra.cross(b, a)


def _fourth(build: KernelBuilder, samples: Samples) -> sp.Matrix:
    b0 = _moment(samples, 0)
    if samples.fit.degree == 1:
        return b0 - _commutator(b0, _moment(samples, 1))
    return b0 + _second_order(samples, 0)


def _sixth(build: KernelBuilder, samples: Samples) -> sp.Matrix:
    def named(name: str, meaning: str, value: sp.Matrix) -> sp.Matrix:
        return build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), value)

    def alpha(number: int, meaning: str, *factors: sp.Expr) -> sp.Matrix:
        """Add a stage for a combination of the moments, which is linear in the samples."""
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
    # The three moments above hold the rate's Legendre polynomials up to the second degree.
    return b0 + _commutator(left, a2 + c2) / 240 + _second_order(samples, 2)
