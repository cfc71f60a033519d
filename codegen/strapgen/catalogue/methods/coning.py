"""Steps by coning coefficients, from increments and their cross products, and the coefficients of the sculling dual.

`least_squares` has coefficients that are shaped over a band of frequencies, in place of being exact at low ones: the
rotation vector is d_0 + ... + d_(N-1) + (sum_s K_s d_(N-1-s)) x d_(N-1), and `coning_drift` has its drift E(b) on
coning of the angular frequency b in rad a sample. The weights K_s are those of the least mean square of E over the band
0 < b <= 1.3, which ends at a fifth of the sampling rate. They are rounded to multiples of 2^-60.

`exact_rest` has combined coefficients with everything else of the polynomial through the samples, integrated exactly:
terms to fourth order are what combined coefficients lose on large slow cones. The step turns by h, by the exact
rotation of the polynomial, and by h again: h is the rotation by half the difference of combined and uncompressed
coefficients, of which the latter are those of the polynomial. The difference is exact for the products of powers of
time in which the two forms agree. In Legendre coefficients of the rate it consists of products of high degree alone.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache

import mpmath
import sympy as sp

from strapgen.catalogue.kinematics import DCM, EULER, Kinematics
from strapgen.catalogue.methods import coning_coefficients, polynomial_rotation, rate_fit, rotation_series
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.method import PHI, Method, Samples, exponential, sample_names
from strapgen.catalogue.methods.rate_fit import step_order
from strapgen.catalogue.methods.rotation_series import Scalars, Words, fraction
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, dot, exact
from strapgen.kernel.kernel import KernelBuilder

#: Most Legendre coefficients of the rate in the terms of third and fourth order.
MOST_COEFFICIENTS = 6

#: Order of a step with terms up to second order in the rate, and of one with terms up to fourth order.
_SECOND, _FOURTH = 4, 6

#: Methods by the suffix of their name: the form of the coefficients, and whether the step has the terms of third and
#: fourth order of the polynomial through the samples.
_METHODS = {
    "compressed": ("compressed", False),
    "uncompressed": ("uncompressed", False),
    "combined": ("combined", True),
    "polynomial": ("uncompressed", True),
}


def by_form(name: str) -> Method:
    """Return a step by the coning coefficients of a name in `_METHODS`."""
    form, terms = _METHODS[name]
    order = _FOURTH if terms else _SECOND

    def coefficients(increments: int, previous: int) -> Design:
        return coning_coefficients.design(increments, previous, form)

    return exponential(
        f"coning-{name}",
        f"{form} coning coefficients{', terms to fourth order' if terms else ''}",
        f"{coning_coefficients.SOURCES[form]}; {rotation_series.SOURCE}"
        if terms
        else coning_coefficients.SOURCES[form],
        order,
        lambda build, samples: (_with_terms if terms else _of_pairs)(build, samples, coefficients),
        limit=_limit(order, coefficients),
        coning=lambda increments, previous: coefficients(increments, previous).pairs,
    )


def shaped(shape: ShapedConing) -> Method:
    """Return a step by coning coefficients for a band or a spectrum, with terms up to second order."""

    def coefficients(increments: int, previous: int) -> Design:
        return Design("shaped", increments, previous, dict(shape.pairs))

    return exponential(
        shape.name,
        f"shaped coning coefficients, {shape.title}",
        shape.source,
        _SECOND,
        lambda build, samples: _of_pairs(build, samples, coefficients),
        option=shape.option,
        limit=_limit(_SECOND, coefficients),
        coning=lambda increments, previous: coefficients(increments, previous).pairs,
    )


def _limit(order: int, coefficients: Callable[[int, int], Design]) -> Callable[[int, int, int], int]:
    """Return the order that samples allow: the first product with an error has a total degree one higher."""
    return lambda increments, previous, ahead: min(order, coefficients(increments, previous).degree + 2)


def _of_pairs(
    build: KernelBuilder, samples: Samples, coefficients: Callable[[int, int], Design]
) -> sp.Matrix:
    """Return the rotation vector as the sum of the increments and of weighted cross products of them."""
    increments = samples.increments
    assert increments is not None, "rates are refused before"
    pairs = coefficients(increments, samples.previous).pairs
    names = sample_names(increments, samples.previous)
    total = samples.combination("increment_sum", samples.fit.moment(0), "integral of the rate over the step")
    if not any(pairs.values()):
        return total
    second = sp.zeros(3, 1)
    for newer in range(1, len(names)):
        weights = [exact(pairs.get((older, newer), Fraction(0))) for older in range(len(names))]
        if any(weights):
            lever = samples.combination(
                f"lever_{names[newer]}",
                weights,
                f"sum of older increments that is crossed with {names[newer]}",
            )
            unit = [sp.Integer(int(k == newer)) for k in range(len(names))]
            second += cross(lever, samples.combination(names[newer], unit, ""))
    return build.stage(PHI, total + second)


def _with_terms(
    build: KernelBuilder, samples: Samples, coefficients: Callable[[int, int], Design]
) -> sp.Matrix:
    """Return the rotation vector in the Legendre coefficients of the rate, where half of the weights vanish."""
    assert samples.increments is not None, "rates are refused before"
    pairs = coefficients(samples.increments, samples.previous).pairs
    vectors = polynomial_rotation.legendre_coefficients(samples)
    second = in_legendre(pairs, samples.increments, samples.previous)
    third, fourth = rotation_series.legendre_terms(min(len(vectors), MOST_COEFFICIENTS), 4)[2:]
    return rotation_series.rotation_vector(build, vectors, (second, third, fourth))


def sample_terms(
    increments: int, previous: int = 0
) -> tuple[dict[int, Scalars], dict[tuple[int, int], Scalars]]:
    """Return the terms of third and fourth order of the polynomial through samples, which count from the oldest."""
    terms = rotation_series.terms(increments + previous, 4)
    third, fourth = (rotation_series.in_samples(words, increments, previous) for words in terms[2:])
    return rotation_series.third_order(third), rotation_series.fourth_order(fourth)


def in_legendre(pairs: Scalars, increments: int, previous: int) -> Scalars:
    """Convert coefficients of cross products of samples to those of the rate's Legendre coefficients."""
    count = increments + previous
    powers = [coning_coefficients.powers(increments, previous, j) for j in range(count)]
    table = [
        {
            m: sum((fraction(c) * powers[j][sample] for j, c in enumerate(rate_fit.legendre(m))), Fraction(0))
            for m in range(count)
        }
        for sample in range(count)
    ]  # every sample in the coefficients
    words: Words = {pair: c for pair, c in pairs.items()}
    return rotation_series.pairs(rotation_series.substituted(words, table))


_LEAST_SQUARES_SOURCE = "P. G. Savage, J. Guid. Control Dyn. 33 (2010), least squares over a band"
#: End of the band in rad, and digits of the arithmetic in which the weights are designed.
BAND, _DIGITS = Fraction(13, 10), 60
#: Bits after the binary point of a weight.
_BITS = 60


def least_squares(order: int) -> Method:
    """Return the step by shaped coefficients, of order 2: at low frequencies coning has a small error, not zero."""

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        increments, previous = samples.increments, samples.previous
        assert increments is not None, "rates are refused before"
        count = increments + previous
        total = samples.combination(
            "increment_sum", samples.fit.moment(0), "integral of the rate over the step"
        )
        if count == 1:
            return total
        newest = sample_names(increments, previous)[-1]
        lever = samples.combination(
            "lever",
            [*(exact(weight) for weight in reversed(weights(increments, previous))), sp.S.Zero],
            f"sum of older increments that is crossed with {newest}",
        )
        unit = [sp.Integer(int(k == count - 1)) for k in range(count)]
        return build.stage(PHI, total + cross(lever, samples.combination(newest, unit, "")))

    return exponential(
        "coning-least-squares",
        "compressed coning coefficients by least squares over a band",
        _LEAST_SQUARES_SOURCE,
        order,
        rotation_vector,
        limit=lambda increments, previous, ahead: order,
    )


@cache
def weights(increments: int, previous: int = 0) -> tuple[Fraction, ...]:
    """Return the weights of the older samples in the lever, the youngest first.

    >>> [round(float(weight), 4) for weight in weights(1, 2)]
    [0.1329, -0.0277]
    """
    if increments + previous == 1:
        return ()
    with mpmath.workdps(_DIGITS):
        harmonics = range(increments + previous + 1)
        squares = [[_sine_times_sine(m, n) for n in harmonics] for m in harmonics]
        slopes = [_ramp_times_sine(n) for n in harmonics]
        # 2 sin(s b) (1 - cos b) in sines of multiples of b.
        columns = [{s: 2, s + 1: -1, s - 1: -1} for s in range(1, increments + previous)]

        def product(one: dict[int, int], other: dict[int, int]) -> mpmath.mpf:
            return mpmath.fsum(x * y * squares[m][n] for m, x in one.items() for n, y in other.items())

        def target(column: dict[int, int]) -> mpmath.mpf:
            ramp = mpmath.fsum(x * slopes[n] for n, x in column.items())
            return (increments * ramp - product(column, {increments: 1})) / 2

        normal = mpmath.matrix([[product(a, b) for b in columns] for a in columns])
        solution = mpmath.lu_solve(normal, mpmath.matrix([target(column) for column in columns]))
        return tuple(Fraction(int(mpmath.nint(weight * 2**_BITS)), 2**_BITS) for weight in solution)


# Coning coefficients that are shaped over a band of frequencies, in place of being exact at low ones.
#
# The rotation vector is d_0 + ... + d_(N-1) + (sum_s K_s d_(N-1-s)) x d_(N-1); `coning_drift` has its drift E(b) on
# coning of the angular frequency b in rad a sample. The weights K_s are those of the least mean square of E over the
# band 0 < b <= 1.3, which ends at a fifth of the sampling rate. They are rounded to multiples of 2^-60.


def _sine_times_sine(m: int, n: int) -> mpmath.mpf:
    """Return the integral of sin(m b) sin(n b) over the band."""
    return (_cosine(m - n) - _cosine(m + n)) / 2


def _cosine(n: int) -> mpmath.mpf:
    """Return the integral of cos(n b) over the band."""
    return mpmath.sin(n * _end()) / n if n else _end()


def _ramp_times_sine(n: int) -> mpmath.mpf:
    """Return the integral of b sin(n b) over the band."""
    return mpmath.sin(n * _end()) / n**2 - _end() * mpmath.cos(n * _end()) / n if n else mpmath.mpf(0)


def _end() -> mpmath.mpf:
    return mpmath.mpf(BAND.numerator) / BAND.denominator


#: Highest power of the exponential of h. At a tenth of a radian the powers left out are below 1e-15 of h.
_POWERS = 8


def exact_rest(order: int) -> Method:
    """Return the step by combined coefficients with the exact rest; series end at the power `order` of time."""

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        parameters = EULER if kinematics is DCM else kinematics
        coefficients = polynomial_rotation.legendre_coefficients(samples)
        parts = polynomial_rotation.series_parts(samples)
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
        limit=_exact_rest_limit,
    )


def _product(
    build: KernelBuilder, parameters: Kinematics, name: str, first: sp.Matrix, then: sp.Matrix
) -> sp.Matrix:
    meaning = "rotation by h and the polynomial" if name == "before" else "the same and h again"
    signal = polynomial_rotation.named(parameters, f"{name}_product", meaning)
    return build.stage(signal, parameters.product(first, then))


def _exact_rest_limit(increments: int, previous: int, ahead: int) -> int:
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
