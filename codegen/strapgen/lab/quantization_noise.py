"""Derives the attitude noise due to the quantization of a gyro, through the rates that a step extracts.

The angle is sampled at the ends of all increments, and every sample carries an error of its own: independent of the
others, with the variance q^2/12 on each axis for a pulse q. To the second power of the increments, a step turns by the
vector

    phi = sum_i alpha_i d_i + sum_(i<j) beta_ij d_i x d_j

Its derivative by the samples at a steady rate w, with the attitude in the middle of the step, is what a sample
contributes to the error of a run; samples at which two steps meet contribute to both. Chapter 6 of the thesis asks for
this.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import sympy as sp

from strapgen import catalogue
from strapgen.catalogue import Choice
from strapgen.catalogue.methods import rate_fit
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import CROSS
from strapgen.kernel.power_series import Powers, constant, outputs
from strapgen.lab.one_step import Step, step

#: Angle of a pulse in rad, rate in rad/s, step and time in s.
PULSE, RATE, STEP, TIME = sp.symbols("q w h t", positive=True)
#: Variance of the error of one sample of the angle on an axis.
SAMPLE = PULSE**2 / 12


@dataclass(frozen=True)
class QuantizationNoise:
    """The error of an attitude that quantized increments cause, as exact variances on an axis in units of q^2/12."""

    #: What every step adds on all axes; 0 for a step in which the samples between steps cancel
    walk: sp.Expr
    #: What every step adds on the axes across the rate, in units of (w h)^2
    turning: sp.Expr
    #: What the samples at the beginning of a run add once, and those at its end. A run whose first angle is
    #: exact lacks the former. Beside a walk they are negligible
    start: sp.Expr
    end: sp.Expr

    def across(self, ends: int = 1) -> sp.Expr:
        """Return the variance on an axis across the rate in rad^2, in the symbols of this module."""
        return self.along(ends) + SAMPLE * self.turning * RATE**2 * STEP * TIME

    def along(self, ends: int = 1) -> sp.Expr:
        """Return the variance on the axis of the rate in rad^2; see `across`."""
        ends = checks.count("ends", ends, largest=2)
        once = self.end + (self.start if ends == 2 else 0)
        return SAMPLE * (once + self.walk * TIME / STEP)

    def mean_square(self, pulse: float, squared_angle: float, steps: int) -> float:
        """Return the mean square of the angle of the error at the end of a run whose first angle is exact.

        `pulse`: angle of a pulse in rad. `squared_angle`: sum of the squares of the angles in rad by which the body
        turns in each step. Returned in rad^2, of all axes together.
        """
        once = 3 * (float(self.end) + float(self.walk) * steps)
        return pulse**2 / 12 * (once + 2 * float(self.turning) * squared_angle)


def quantization_noise(choice: Choice) -> QuantizationNoise:
    """Derive the noise of an attitude step.

    A step of fourth order is exact for a linear rate, and has the factor 5/9:

    >>> noise = quantization_noise(catalogue.choose_step("euler", "rk4", 2))
    >>> noise.walk, noise.turning, noise.end
    (0, 5/9, 1)
    >>> sp.expand(noise.across())
    5*h*q**2*t*w**2/108 + q**2/12
    """
    attitude_step = step(choice)
    if attitude_step.nodes is not None:
        raise InputError(
            f"kernel {attitude_step.kernel.name} takes no increments; a step that takes increments is needed"
        )
    rotation, increments = _rotation(attitude_step)
    return polynomial_noise(rotation, increments, choice.previous, choice.ahead)


def polynomial_noise(
    rotation: Sequence[sp.Expr], increments: Sequence[Sequence[sp.Symbol]], previous: int = 0, ahead: int = 0
) -> QuantizationNoise:
    """Derive the noise of a step whose rotation vector is a polynomial in its increments.

    `rotation` (3,): the rotation vector of a step; terms above the second power do not matter. `increments` (K,
    3): the increments that it takes, oldest first.

    >>> d1, d2 = (sp.Matrix(sp.symbols(f"{name}x {name}y {name}z")) for name in "ab")
    >>> [polynomial_noise(d1 + d2 + c * d1.cross(d2), [d1, d2]).turning for c in (0, sp.Rational(1, 2), 2)]
    [1, 1/2, 5]
    """
    count = len(increments) - previous - ahead
    if count < 1:
        raise InputError(f"of {len(increments)} increments none lies in the step; at least one is needed")
    linear, products = _weights(rotation, increments)
    steady, turning = _of_samples(linear, products, count)
    # A sample is number m of one step and number m - count of the next: attitudes in the middle of both, seen from it,
    # differ by the angles w h (1/2 - m/count).
    total: dict[int, sp.Expr] = defaultdict(lambda: sp.S.Zero)
    crossed: dict[int, sp.Expr] = defaultdict(lambda: sp.S.Zero)
    for place, (a, b) in enumerate(zip(steady, turning, strict=True)):
        number = place - previous
        total[number % count] += a
        crossed[number % count] += b + (sp.Rational(1, 2) - sp.Rational(number, count)) * a
    walk = sp.Add(*(a**2 for a in total.values()))
    start, end = _ends(steady, previous, count, walk)
    added = (walk, sp.Add(*(b**2 for b in crossed.values())), start, end)
    return QuantizationNoise(*(sp.expand(part) for part in added))


def extraction_noise(increments: int, node: sp.Expr, previous: int = 0, ahead: int = 0) -> sp.Expr:
    """Return the standard deviation of a rate that is extracted from quantized increments.

    Returned in rad/s on each axis, in the symbols of this module.

    The thesis's extraction on two increments, at the beginning and in the middle of a step:

    >>> [extraction_noise(2, sp.sympify(node)) for node in ("0", "1/2")]
    [sqrt(78)*q/(6*h), sqrt(6)*q/(6*h)]
    """
    increments = checks.count("increments", increments)
    weights = rate_fit.from_increments(increments, previous, ahead).at(node)
    return sp.sqrt(sp.Add(*(a**2 for a in _differences(weights))) / 12) * PULSE / STEP


def _rotation(attitude_step: Step) -> tuple[list[sp.Expr], list[tuple[sp.Symbol, ...]]]:
    """Return the rotation vector of a step to the second power, and the increments in whose symbols it is."""
    kernel, step_kernels = attitude_step.kernel, attitude_step.kernel.attitude_step
    assert step_kernels is not None, "checked by `step`"
    state, samples = kernel.inputs
    ring = sp.ring(list(samples.elements), attitude_step.domain)[0]
    values = {
        name: constant(ring, sp.Rational(x.numerator, x.denominator), 2)
        for name, x in zip(state.elements, step_kernels.identity, strict=True)
    }
    values |= {
        name: Powers(ring, {1: element}, 2) for name, element in zip(samples.elements, ring.gens, strict=True)
    }
    elements = outputs(kernel, values, ring, 2)[kernel.outputs[-1].signal.name]
    if step_kernels.attitude is not None:
        attitude = catalogue.companion(kernel, step_kernels.attitude)
        named = dict(zip(attitude.inputs[0].elements, elements, strict=True))
        elements = outputs(attitude, named, ring, 2)[attitude.outputs[-1].signal.name]
    # A matrix is its rotation vector's skew matrix and what is symmetric, up to the third power.
    vector = [
        (elements[3 * i + j] - elements[3 * j + i]) * constant(ring, sp.Rational(1, 2), 2)
        for i, j in ((2, 1), (0, 2), (1, 0))
    ]
    symbols = [sp.Symbol(name) for name in samples.elements]
    triples = [(symbols[k], symbols[k + 1], symbols[k + 2]) for k in range(0, len(symbols), 3)]
    return [sp.Add(*(part.as_expr() for part in x.parts.values())) for x in vector], triples


def _weights(
    rotation: Sequence[sp.Expr], increments: Sequence[Sequence[sp.Symbol]]
) -> tuple[list[sp.Expr], dict[tuple[int, int], sp.Expr]]:
    """Return the weights of the increments in a rotation vector, and those of their cross products."""
    symbols = [symbol for vector in increments for symbol in vector]
    x, *_ = polynomials = [sp.Poly(sp.expand(element), *symbols) for element in rotation]

    def powers_of(*elements: tuple[int, int]) -> tuple[int, ...]:
        """Return the powers of a product of elements, each a vector and its axis."""
        places = [3 * vector + axis for vector, axis in elements]
        return tuple([int(place in places) for place in range(len(symbols))])

    linear = [x.coeff_monomial(powers_of((i, 0))) for i in range(len(increments))]
    products = {
        (i, j): x.coeff_monomial(powers_of((i, 1), (j, 2)))
        for i, j in combinations(range(len(increments)), 2)
    }
    for axis, ((a, b), polynomial) in enumerate(zip(CROSS, polynomials, strict=True)):
        again = {powers_of((i, axis)): weight for i, weight in enumerate(linear)}
        for (i, j), weight in products.items():
            again |= {powers_of((i, a), (j, b)): weight, powers_of((i, b), (j, a)): -weight}
        rest = polynomial - sp.Poly.from_dict(again, *symbols)
        if any(sum(powers) < 3 and coefficient != 0 for powers, coefficient in rest.terms()):
            raise InputError(
                "the rotation vector is no sum of increments and their cross products to the second power: "
                f"{sp.Poly(rest, *symbols).as_expr()} is left"
            )
    return linear, products


def _of_samples(
    linear: Sequence[sp.Expr], products: dict[tuple[int, int], sp.Expr], count: int
) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """Return the weight of each sample's error in the rotation vector, and that of h w x the error."""
    crossed = [sp.S.Zero] * len(linear)
    for (i, j), weight in products.items():  # at a steady rate, d_i = w h/count for every increment
        crossed[i] -= weight / count
        crossed[j] += weight / count
    return _differences(linear), _differences(crossed)


def _differences(weights: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Return the weights of samples from those of increments, which are differences of samples."""
    zero = [sp.S.Zero]
    return [before - after for before, after in zip([*zero, *weights], [*weights, *zero], strict=True)]


def _ends(steady: Sequence[sp.Expr], previous: int, count: int, walk: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the shares of the samples at the beginning and the end of a run, in addition to those of every step."""
    half = len(steady) + 1  # steps of half a run, which no sample of one end leaves
    total: dict[int, sp.Expr] = defaultdict(lambda: sp.S.Zero)
    for k in range(2 * half):
        for place, a in enumerate(steady):
            total[k * count + place - previous] += a
    middle = half * count
    early = sp.Add(*(a**2 for number, a in total.items() if number < middle)) + total[middle] ** 2 / 2
    late = sp.Add(*(a**2 for number, a in total.items() if number > middle)) + total[middle] ** 2 / 2
    return early - half * walk, late - half * walk
