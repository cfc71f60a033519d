"""The rotation over a step by a rate that is a polynomial of time, as a power series in time.

With the rate sum_j g_j t^j and the transition sum_n P_n t^n, dP/dt = f(P, g), f bilinear, gives
(n + 1) P_(n+1) = sum_j f(P_(n-j), g_j).

A series about the middle of an interval meets time no further away than half the interval, at both ends. Where the rate
turns far during a step, powers of time grow and cancel; the step is then cut into parts, each with a series of its own.
The series of Euler parameters, cut off, is not of length 1: the result is normalized.

`fit_exact` is the limit of every method that fits and iterates: functional iteration on Rodrigues parameters, rotation
vectors or quaternions converges to this rotation. `taylor` is the plain series of an order. With three samples or more,
and a motion that is fast for the sampling, the polynomial's coefficients grow with the power of time and nearly cancel
at the end of the step; a series that is cut off before they cancel is no rotation, and the state grows or shrinks from
step to step. From three samples on it therefore starts in the middle of the step, and the result is normalized.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.catalogue.kinematics import DCM, EULER, Kinematics
from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.method import Method, Samples
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import KernelBuilder

SOURCE = "E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), I.8"


def rotation(
    build: KernelBuilder,
    kinematics: Kinematics,
    coefficients: Sequence[sp.Matrix],
    order: int,
    parts: int = 1,
) -> sp.Matrix:
    """Add stages for the rotation over a step from Legendre coefficients c_m of the rate times the step, in rad.

    With the rate sum_m c_m P_m(2 t - 1), t from 0 to 1, a series over each of the equal parts ends at the power `order`
    of time. The transition is a rotation whatever the coefficients are.

    >>> build = KernelBuilder()
    >>> still, turn = build.input(Signal.vector("c0", "c0")), build.input(Signal.vector("c1", "c1"))
    >>> [element.is_Mul for element in rotation(build, EULER, [still, turn], 4)]
    [True, True, True, True]
    >>> [stage.signal.name for stage in build.stages][:4]
    ['half_rate_0', 'half_rate_1', 'term_1', 'term_2']
    """
    parameters = EULER if kinematics is DCM else kinematics
    return normalized(build, kinematics, series(build, parameters, coefficients, order, parts))


def series(
    build: KernelBuilder,
    parameters: Kinematics,
    coefficients: Sequence[sp.Matrix],
    order: int,
    parts: int = 1,
) -> sp.Matrix:
    """Add stages for the rotation over a step before it is normalized, in Euler or Cayley-Klein parameters."""
    total = None
    for part in range(parts):
        label = f"part{part + 1}_" if parts > 1 else ""
        rates = _rates(build, parameters.scale, coefficients, order, (part, parts))
        one = centred(build, parameters, rates, order, label)
        total = (
            one
            if total is None
            else build.stage(
                named(parameters, f"{label}total", f"transition over the first {part + 1} parts"),
                parameters.product(total, one),
            )
        )
    assert total is not None, "a step has at least one part"
    return total


# Taylor series of the transition in time, for a rate that is a polynomial of time: see `polynomial_rotation`.
#
# With three samples or more, and a motion that is fast for the sampling, the polynomial's coefficients grow with the
# power of time and nearly cancel at the end of the step. A series that is cut off before they cancel is no rotation:
# the state grows or shrinks from step to step. From three samples on the series therefore starts in the middle of the
# step, so that time is at most half a step at both ends, and the result is normalized.


def _rates(
    build: KernelBuilder,
    scale: sp.Rational,
    coefficients: Sequence[sp.Matrix],
    order: int,
    place: tuple[int, int],
) -> list[sp.Matrix]:
    """Add stages for the coefficients of the powers of time in the generator over one of several parts of the step.

    Time counts from the middle of the part, in halves of the part.
    """
    part, parts = place
    middle, half = sp.Rational(2 * part + 1, 2 * parts), sp.Rational(1, 2 * parts)
    columns = [rate_fit.legendre(degree, middle) for degree in range(len(coefficients))]
    label = f"part{part + 1}_" if parts > 1 else ""
    of, prefix = ("half of ", "half_") if scale == sp.Rational(1, 2) else ("", "")
    rates = []
    for power in range(min(order, len(coefficients))):
        total = sp.zeros(3, 1)
        for coefficient, column in zip(coefficients[power:], columns[power:], strict=True):
            total += scale * half ** (power + 1) * column[power] * coefficient
        name = f"{label}{prefix}rate_{power}"
        over = f"part {part + 1} of {parts} of the step" if parts > 1 else "the step"
        meaning = f"coefficient of t^{power} in {of}the rate times half of {over}, t from its middle"
        rates.append(build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), total))
    return rates


def centred(
    build: KernelBuilder, parameters: Kinematics, rates: Sequence[sp.Matrix], order: int, label: str = ""
) -> sp.Matrix:
    """Add stages for the transition over an interval by the series about its middle, in halves of the interval.

    `parameters` are Euler or Cayley-Klein; their length is 1 but for what is cut off.
    """
    powers = series_terms(build, parameters, rates, order, "half a step", label)
    even, odd = (sum(powers[k + 2 :: 2], powers[k]) for k in (0, 1))
    even = build.stage(named(parameters, f"{label}even", "terms of even order"), even)
    odd = build.stage(named(parameters, f"{label}odd", "terms of odd order"), odd)
    # Backwards the terms of odd order change sign, and the inverse of unit parameters is the conjugate.
    return build.stage(
        named(parameters, f"{label}series", "transition before it is normalized"),
        parameters.product(
            parameters.identity.multiply_elementwise(even - odd) * 2 - (even - odd), even + odd
        ),
    )


def normalized(build: KernelBuilder, kinematics: Kinematics, series: sp.Matrix) -> sp.Matrix:
    """Add stages that normalize Euler or Cayley-Klein parameters, and return them as a transition."""
    square = algebra.dot(series, series)
    if kinematics is DCM:
        factor = build.value("inverse_square", 1 / square, "1/(series . series)")
        return factor * algebra.quaternion_matrix(series)
    return build.value("inverse_length", 1 / sp.sqrt(square), "1/|series|") * series


def series_terms(
    build: KernelBuilder,
    kinematics: Kinematics,
    rates: Sequence[sp.Matrix],
    order: int,
    length: str = "the step length",
    label: str = "",
) -> list[sp.Matrix]:
    """Add stages for the terms of the series up to an order, the identity first; `length` names the unit of time."""
    series = [kinematics.identity]
    for power in range(1, order + 1):
        total = sp.zeros(*kinematics.identity.shape)
        for j, rate in enumerate(rates[:power]):
            total += kinematics.derivative(series[power - 1 - j], rate)
        signal = named(kinematics, f"{label}term_{power}", f"term of order {power} in {length}")
        series.append(build.stage(signal, total / power))
    return series


def named(kinematics: Kinematics, name: str, meaning: str) -> Signal:
    """Return a signal of the shape of a transition."""
    elements = tuple(f"{name}_{element.rsplit('_', 1)[1]}" for element in kinematics.transition.elements)
    return Signal(name, kinematics.transition.shape, elements, meaning=meaning)


#: Lowest degree of the polynomial for which the series is taken from the middle of the step.
_CENTRED = 2


def taylor(order: int) -> Method:
    """Return the Taylor series to the power `order` of the step."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        if samples.fit.degree >= _CENTRED:
            return _series_about_middle(build, kinematics, samples, order)
        rates = _taylor_rates(samples, kinematics.scale, order)
        terms = series_terms(build, kinematics, rates, order)
        return sum(terms[1:], terms[0])

    def attitude_order(degree: int | None) -> int:
        # A step that is its own inverse in reversed time is of even order.
        return order if degree is None or degree < _CENTRED else order + order % 2

    return Method(
        f"taylor{order}",
        f"Taylor series of order {order}",
        SOURCE,
        order,
        transition,
        attitude_order=attitude_order,
        isometry=lambda count: count is not None and count > _CENTRED,
    )


def _series_about_middle(
    build: KernelBuilder, kinematics: Kinematics, samples: Samples, order: int
) -> sp.Matrix:
    """Return the transition over the step by the series about its middle, normalized."""
    parameters = EULER if kinematics is DCM else kinematics
    rates = _taylor_rates(samples, parameters.scale, order, sp.Rational(1, 2))
    return normalized(build, kinematics, centred(build, parameters, rates, order))


def _taylor_rates(
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


#: Increments of a step in a part that has a series of its own: with 16 terms in each, more terms or more parts change
#: the drift by less than 1e-4 of itself on a cone of 15 deg at a fifth of the sampling rate.
_INCREMENTS = 2


def fit_exact(order: int) -> Method:
    """Return the rotation of the polynomial through the samples; series end at the power `order` of time."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        return rotation(build, kinematics, legendre_coefficients(samples), order, series_parts(samples))

    return Method(
        "fit-exact",
        "exact rotation of the polynomial through the increments",
        f"Y. Wu, G. Yan, arXiv:1901.03468 (2019), at the limit of the iteration; {SOURCE}",
        order,
        transition,
        isometry=lambda count: True,
    )


def legendre_coefficients(samples: Samples) -> list[sp.Matrix]:
    """Add stages for the Legendre coefficients of the rate times the step, in rad."""
    return [
        samples.combination(
            f"legendre_{m}",
            samples.fit.legendre(m),
            f"Legendre coefficient {m} of the rate times the step",
        )
        for m in range(samples.fit.degree + 1)
    ]


def series_parts(samples: Samples) -> int:
    """Return the number of equal parts of a step, each with a series of its own."""
    assert samples.increments is not None, "rates are refused before"
    return -(-samples.increments // _INCREMENTS)
