"""Taylor series of the transition in time, for a rate that is a polynomial of time.

With the rate sum_j g_j t^j and the transition sum_n P_n t^n, dP/dt = f(P, g), f bilinear, gives
(n + 1) P_(n+1) = sum_j f(P_(n-j), g_j).

With three samples or more, and a motion that is fast for the sampling, the polynomial's coefficients grow with the
power of time and nearly cancel at the end of the step. A series that is cut off before they cancel is no rotation: the
state grows or shrinks from step to step. From three samples on the series therefore starts in the middle of the step,
so that time is at most half a step at both ends, and the result is normalized.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.catalogue.kinematics import DCM, EULER, Kinematics
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.samples import Samples
from strapgen.ir.signals import Signal
from strapgen.symbolic import rotations
from strapgen.symbolic.kernel import KernelBuilder

#: Lowest degree of the polynomial for which the series is taken from the middle of the step.
_CENTRED = 2


def method(order: int) -> Method:
    """Return the Taylor series of an order.

    Parameters
    ----------
    order : int
        Power of the step at which the series is cut.
    """

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        if samples.fit.degree >= _CENTRED:
            return _centred(build, kinematics, samples, order)
        rates = _rates(samples, kinematics.scale, order)
        terms = _terms(build, kinematics, rates, order)
        return sum(terms[1:], terms[0])

    def attitude_order(degree: int | None) -> int:
        # A step that is its own inverse in reversed time is of even order.
        return order if degree is None or degree < _CENTRED else order + order % 2

    return Method(
        f"taylor{order}",
        f"Taylor series of order {order}",
        "E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), I.8",
        order,
        transition,
        attitude_order=attitude_order,
        isometry=lambda count: count is not None and count > _CENTRED,
    )


def _centred(build: KernelBuilder, kinematics: Kinematics, samples: Samples, order: int) -> sp.Matrix:
    """Return the transition from the beginning of the step to its end by the series about its middle, normalized.

    Direction cosines take the rotation of Euler parameters, which is exact for parameters of any length.
    """
    parameters = EULER if kinematics is DCM else kinematics
    rates = _rates(samples, parameters.scale, order, sp.Rational(1, 2))
    terms = _terms(build, parameters, rates, order, "half a step")
    even, odd = (sum(terms[k + 2 :: 2], terms[k]) for k in (0, 1))
    even = build.stage(_named(parameters, "even", "terms of even order"), even)
    odd = build.stage(_named(parameters, "odd", "terms of odd order"), odd)
    # Backwards the terms of odd order change sign, and the inverse of unit parameters is the conjugate.
    series = build.stage(
        _named(parameters, "series", "transition before it is normalized"),
        parameters.product(
            parameters.identity.multiply_elementwise(even - odd) * 2 - (even - odd), even + odd
        ),
    )
    square = rotations.dot(series, series)
    if kinematics is DCM:
        factor = build.value("inverse_square", 1 / square, "1/(series . series)")
        return factor * rotations.quaternion_matrix(series)
    return build.value("inverse_length", 1 / sp.sqrt(square), "1/|series|") * series


def _rates(
    samples: Samples, scale: sp.Rational, order: int, middle: sp.Rational = sp.S.Zero
) -> list[sp.Matrix]:
    """Add stages for the coefficients of the powers of time in the generator, up to the order; return their symbols.

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


def _terms(
    build: KernelBuilder,
    kinematics: Kinematics,
    rates: Sequence[sp.Matrix],
    order: int,
    length: str = "the step length",
) -> list[sp.Matrix]:
    """Add stages for the terms of the series up to the order; the term of order 0 is the identity."""
    terms = [kinematics.identity]
    for power in range(1, order + 1):
        total = sp.zeros(*kinematics.identity.shape)
        for j, rate in enumerate(rates[:power]):
            total += kinematics.derivative(terms[power - 1 - j], rate)
        signal = _named(kinematics, f"term_{power}", f"term of order {power} in {length}")
        terms.append(build.stage(signal, total / power))
    return terms


def _named(kinematics: Kinematics, name: str, meaning: str) -> Signal:
    """Return a signal of the shape of a transition."""
    elements = tuple(f"{name}_{element.rsplit('_', 1)[1]}" for element in kinematics.transition.elements)
    return Signal(name, kinematics.transition.shape, elements, meaning=meaning)
