"""Taylor series of the transition in time, for a rate that is a polynomial of time."""

from __future__ import annotations

import sympy as sp

from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.steps import Method, Samples
from strapgen.kernel import KernelBuilder
from strapgen.signal import Signal


def method(order: int) -> Method:
    """Return the Taylor series of an order.

    With the rate sum_j g_j t^j and the transition sum_n P_n t^n, dP/dt = f(P, g), f bilinear, gives
    (n + 1) P_(n+1) = sum_j f(P_(n-j), g_j).

    Parameters
    ----------
    order : int
        Power of the step at which the series is cut.
    """

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        half, of = ("half_", "half of ") if kinematics.scale == sp.Rational(1, 2) else ("", "")
        rates: list[sp.Matrix] = []
        for power in range(order):
            weights = samples.fit.taylor(power)
            if not any(weights):
                break
            meaning = f"coefficient of t^{power} in {of}the rate times the step"
            rates.append(samples.combination(f"{half}rate_{power}", weights, meaning, kinematics.scale))
        terms = [kinematics.identity]
        for power in range(1, order + 1):
            total = sp.zeros(*kinematics.identity.shape)
            for j, rate in enumerate(rates[:power]):
                total += kinematics.derivative(terms[power - 1 - j], rate)
            elements = tuple(
                f"term_{power}_{element.rsplit('_', 1)[1]}" for element in kinematics.transition.elements
            )
            signal = Signal(
                f"term_{power}",
                kinematics.transition.shape,
                elements,
                meaning=f"term of order {power} in the step length",
            )
            terms.append(build.stage(signal, total / power))
        return sum(terms[1:], terms[0])

    return Method(
        f"taylor{order}",
        f"Taylor series of order {order}",
        "E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), I.8",
        order,
        transition,
    )
