"""Taylor series of the transition in time, for a rate that is a polynomial of time: see `polynomial_rotation`.

With three samples or more, and a motion that is fast for the sampling, the polynomial's coefficients grow with the
power of time and nearly cancel at the end of the step. A series that is cut off before they cancel is no rotation: the
state grows or shrinks from step to step. From three samples on the series therefore starts in the middle of the step,
so that time is at most half a step at both ends, and the result is normalized.
"""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.kinematics import DCM, EULER, Kinematics
from strapgen.catalogue.methods import polynomial_rotation
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.samples import Samples
from strapgen.kernel.kernel import KernelBuilder

#: Lowest degree of the polynomial for which the series is taken from the middle of the step.
_CENTRED = 2


def method(order: int) -> Method:
    """Return the Taylor series to the power `order` of the step."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        if samples.fit.degree >= _CENTRED:
            return _centred(build, kinematics, samples, order)
        rates = _rates(samples, kinematics.scale, order)
        terms = polynomial_rotation.terms(build, kinematics, rates, order)
        return sum(terms[1:], terms[0])

    def attitude_order(degree: int | None) -> int:
        # A step that is its own inverse in reversed time is of even order.
        return order if degree is None or degree < _CENTRED else order + order % 2

    return Method(
        f"taylor{order}",
        f"Taylor series of order {order}",
        polynomial_rotation.SOURCE,
        order,
        transition,
        attitude_order=attitude_order,
        isometry=lambda count: count is not None and count > _CENTRED,
    )


def _centred(build: KernelBuilder, kinematics: Kinematics, samples: Samples, order: int) -> sp.Matrix:
    """Return the transition over the step by the series about its middle, normalized."""
    parameters = EULER if kinematics is DCM else kinematics
    rates = _rates(samples, parameters.scale, order, sp.Rational(1, 2))
    return polynomial_rotation.normalized(
        build, kinematics, polynomial_rotation.centred(build, parameters, rates, order)
    )


def _rates(
    samples: Samples, scale: sp.Rational, order: int, middle: sp.Rational = sp.S.Zero
) -> list[sp.Matrix]:
    """Add stages for the coefficients of the powers of time in the generator, up to the order.

    Time counts from a moment of the step, in steps; from the middle, in halves of the step.
    """
    half, of = ("half_", "half of ") if scale == sp.Rational(1, 2) else ("", "")
    unit, since = ("half the step", ", t from its middle") if middle else ("the step", "")
    rates: list[sp.Matrix] = []
    for power in range(order):
        weights = samples.fit.taylor(power, middle)
        if not any(weights):
            break
        factor = scale * (middle ** (power + 1) if middle else 1)
        meaning = f"coefficient of t^{power} in {of}the rate times {unit}{since}"
        rates.append(samples.combination(f"{half}rate_{power}", weights, meaning, factor))
    return rates
