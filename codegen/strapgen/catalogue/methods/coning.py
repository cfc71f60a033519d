"""Steps by coning coefficients, from increments and their cross products, and the coefficients of the sculling dual."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.methods import (
    coning_coefficients,
    fit_exact,
    legendre_vector,
    rate_fit,
    rotation_series,
)
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.method import PHI, Method, exponential
from strapgen.catalogue.methods.rotation_series import Scalars, Words, fraction
from strapgen.catalogue.methods.samples import Samples, sample_names
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.kernel.algebra import cross, exact
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


def method(name: str) -> Method:
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
    vectors = fit_exact.coefficients(samples)
    second = in_legendre(pairs, samples.increments, samples.previous)
    third, fourth = rotation_series.legendre_terms(min(len(vectors), MOST_COEFFICIENTS), 4)[2:]
    return legendre_vector.rotation_vector(build, vectors, (second, third, fourth))


def sample_terms(
    increments: int, previous: int = 0
) -> tuple[dict[int, Scalars], dict[tuple[int, int], Scalars]]:
    """Return the terms of third and fourth order of the polynomial through samples, which count from the oldest."""
    terms = rotation_series.terms(increments + previous, 4)
    third, fourth = (rotation_series.in_samples(words, increments, previous) for words in terms[2:])
    return rotation_series.third(third), rotation_series.fourth(fourth)


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
