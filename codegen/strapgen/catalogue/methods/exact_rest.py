"""Combined coning coefficients with everything else of the polynomial through the samples, integrated exactly.

Terms to fourth order are what combined coefficients lose on large slow cones. Here the step turns by h, by the exact
rotation of the polynomial, and by h again: h is the rotation by half the difference of
combined and uncompressed coefficients, of which the latter are those of the polynomial.

The difference is exact for the products of powers of time in which the two forms agree. In the Legendre coefficients of
the rate it consists of products of high degree alone.
"""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import DCM, EULER, Kinematics
from strapgen.catalogue.methods import coning_coefficients, fit_exact, polynomial_rotation
from strapgen.catalogue.methods.coning import in_legendre
from strapgen.catalogue.methods.method import Method
from strapgen.catalogue.methods.rate_fit import step_order
from strapgen.catalogue.methods.samples import Samples
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, dot, exact
from strapgen.kernel.kernel import KernelBuilder

#: Highest power of the exponential of h. At a tenth of a radian the powers left out are below 1e-15 of h.
_POWERS = 8


def method(order: int) -> Method:
    """Return the step by combined coefficients with the exact rest; series end at the power `order` of time."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        parameters = EULER if kinematics is DCM else kinematics
        coefficients = fit_exact.coefficients(samples)
        parts = fit_exact.parts(samples)
        total = polynomial_rotation.series(build, parameters, coefficients, order, parts)
        rest = _rest(samples, coefficients)
        if rest.is_zero_matrix:
            return polynomial_rotation.normalized(build, kinematics, total)
        signal = Signal.vector("rest", "rest", unit="rad", meaning="half of what combined coefficients add")
        vector = build.stage(signal, rest)
        square = build.value("rest_square", dot(vector, vector), "square of its length")
        half = build.stage(
            polynomial_rotation.named(parameters, "half_rest", "rotation by it"),
            parameters.exponential(vector, _POWERS, square),
        )
        before = _product(build, parameters, "before", half, total)
        total = _product(build, parameters, "whole", before, half)
        return polynomial_rotation.normalized(build, kinematics, total)

    return Method(
        "coning-exact-rest",
        "combined coning coefficients with the exact rotation of the polynomial",
        f"{coning_coefficients.SOURCES['combined']}; {polynomial_rotation.SOURCE}",
        order,
        transition,
        isometry=lambda count: True,
        limit=_limit,
    )


def _product(
    build: KernelBuilder, parameters: Kinematics, name: str, first: sp.Matrix, then: sp.Matrix
) -> sp.Matrix:
    meaning = "rotation by h and the polynomial" if name == "before" else "the same and h again"
    signal = polynomial_rotation.named(parameters, f"{name}_product", meaning)
    return build.stage(signal, parameters.product(first, then))


def _limit(increments: int, previous: int, ahead: int) -> int:
    """Return the order that samples allow: that of the polynomial, in which the difference of the forms is no error."""
    degree = coning_coefficients.design(increments, previous, "combined").degree
    return min(step_order(increments, previous, ahead), degree + 2)


def _rest(samples: Samples, coefficients: list[sp.Matrix]) -> sp.Matrix:
    """Return half the difference of combined and uncompressed coefficients, as a vector."""
    increments, previous = samples.increments, samples.previous
    assert increments is not None, "rates are refused before"
    combined, plain = (
        coning_coefficients.design(increments, previous, form).pairs for form in ("combined", "uncompressed")
    )
    difference = {pair: c - plain.get(pair, Fraction(0)) for pair, c in combined.items()}
    total = sp.zeros(3, 1)
    for (k, m), c in in_legendre(difference, increments, previous).items():
        total += exact(c / 2) * cross(coefficients[k], coefficients[m])
    return total
