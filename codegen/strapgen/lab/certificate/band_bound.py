"""A bound of the angle from the true attitude of a run whose rate is a sum of lines in a band.

With the time tau from 0 to 1 over a step, the true rate times the step is w + d, w the rate that the step fits to its
samples; both have Legendre coefficients, n_m and d_m in length. The rotation of w + d is that of w, but for a rotation
E with E' = E (R d)x, R(tau) the rotation of w. As E keeps lengths, |E - 1 - int (R d)x| <= (int |d|)^2/2, so that the
sine of its angle is at most |int R d| + (int |d|)^2/2. R is 1 + a + b + c + ..., a = int wx, b = int a wx, and so on;
what is of four factors and more is at most (int |w|)^4/24. Legendre polynomials are orthogonal: of int a d the
products of neighbours are left,

  |int a d| <= sum_m (n_m d_(m+1) + n_(m+1) d_m)/(2 (2m+1) (2m+3)) + n_0 d_0/2,

and of int b d and int c d those with finitely many d_m, whose rational factors are worked out here.

d_m is at most e_m times the sum of the amplitudes: e_m is the largest distance, in the band, of the fitted response
from that of a Legendre coefficient. Both are power series of the frequency with rational coefficients.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Rational

from strapgen.catalogue.methods import rate_fit
from strapgen.catalogue.methods.rate_fit import Fit

Array = NDArray[np.float64]

#: Legendre coefficients of the true rate that are told apart; those beyond are bounded together.
_COEFFICIENTS = 32
#: Powers of the frequency in a response, bits of their balls, and parts of the band.
_POWERS, _BITS, _PARTS = 120, 320, 512
#: What roundings in double may add to a sum.
_SLACK = 1 + 1e-9
#: Highest degree whose products of four factors are told apart.
_FOUR_FACTORS = 2


@dataclass(frozen=True)
class BandBound:
    """The bound of the angle that a step adds, from the fitted rates of a run."""

    #: (M + 1, samples): weights of the samples in the Legendre coefficients of the rate
    weights: Array
    #: Bounds of what the coefficients miss, in rad
    missed: Array

    @classmethod
    def of(cls, fit: Fit, increments: int, previous: int, band: float, amplitude: float) -> BandBound:
        """Return the bound of a step.

        `band`: highest angular frequency in rad a sample. `amplitude`: sum of the amplitudes of the rate's lines, in
        rad a sample.
        """
        filters = [[Fraction(int(x.p), int(x.q)) for x in fit.legendre(m)] for m in range(fit.degree + 1)]
        levels = [
            level(filters[m] if m < len(filters) else (), m, increments, previous, band)
            for m in range(_COEFFICIENTS)
        ]
        weights = np.array([[float(x) for x in row] for row in filters])
        return cls(weights, np.array(levels) * amplitude * _SLACK)

    def angles(self, samples: Array) -> Array:
        """Return the bounds of the angles that steps add, in rad.

        `samples` (N, samples, 3): increments in rad.
        """
        coefficients = np.einsum("mk,nka->nma", self.weights, samples)
        sizes = np.abs(self.weights) @ np.abs(samples).max(axis=2).T * 1e-14  # what rounding may hide
        n = np.linalg.norm(coefficients, axis=2) * _SLACK + sizes.T
        d, degree = self.missed, n.shape[1]
        # Of all coefficients, the squares over 2 m + 1 add up to the mean square; those beyond fall by halves and more.
        whole = math.sqrt(sum(x**2 / (2 * m + 1) for m, x in enumerate(d)) + 2 * d[-1] ** 2)
        linear = np.zeros(len(d))  # the factor of each n in the products of two factors
        for m in range(len(d) - 1):
            factor = 1 / (2 * (2 * m + 1) * (2 * m + 3))
            linear[m] += factor * d[m + 1]
            linear[m + 1] += factor * d[m]
        linear[0] += d[0] / 2
        three, four = factors(degree - 1, 2), factors(min(degree - 1, _FOUR_FACTORS), 3)
        square = _weighed(three, d, degree)
        cube = _weighed(four, d, degree)
        speed = n.sum(axis=1)
        # Products of four factors with a coefficient of higher degree, and those of five and more.
        low = n[:, : _FOUR_FACTORS + 1].sum(axis=1)
        rest = (speed**3 - low**3) / 6 + speed**4 / 24
        total = (
            d[0]
            + n @ linear[:degree]
            + np.einsum("ni,nj,ij->n", n, n, square)
            + np.einsum("ni,nj,nk,ijk->n", n, n, n, cube)
            + np.maximum(rest, 0) * whole
            + whole**2 / 2
        ) * _SLACK
        return np.asarray(np.where(total < 1, np.arcsin(np.minimum(total, 1)), np.pi) * _SLACK)


def _weighed(table: dict[tuple[int, ...], dict[int, Fraction]], d: Array, degree: int) -> Array:
    """Return the sums of the factors of the d_m, for each product of fitted coefficients."""
    rank = len(next(iter(table)))
    weighed = np.zeros((degree,) * rank)
    for place, row in table.items():
        weighed[place] = sum(abs(float(c)) * d[m] for m, c in row.items()) * _SLACK
    return weighed


@cache
def factors(degree: int, count: int) -> dict[tuple[int, ...], dict[int, Fraction]]:
    """Return the factors of products of so many fitted coefficients with one that is missed.

    The entry of (i, j) at m is the integral of P_m(t) times that to t of P_j times the integral of P_i, P the Legendre
    polynomials of the step; of (i, j, k), with one integral more.

    >>> factors(0, 2)
    {(0, 0): {0: Fraction(1, 6), 1: Fraction(1, 12), 2: Fraction(1, 60)}}
    """
    polynomials = [_legendre(m) for m in range((count + 1) * degree + count + 1)]
    inner: dict[tuple[int, ...], list[Fraction]] = {(): [Fraction(1)]}
    for _ in range(count):
        inner = {
            (*place, j): _integral(_product(row, polynomials[j]))
            for place, row in inner.items()
            for j in range(degree + 1)
        }
    table = {}
    for place, row in inner.items():
        values = {m: sum(_integral(_product(row, polynomials[m]))) for m in range(len(row))}
        table[place] = {m: Fraction(value) for m, value in values.items() if value}
    return table


@cache
def _legendre(m: int) -> tuple[Fraction, ...]:
    return tuple(Fraction(int(x.p), int(x.q)) for x in rate_fit.legendre(m))


def _product(x: Sequence[Fraction], y: Sequence[Fraction]) -> list[Fraction]:
    """Return the product of two polynomials."""
    result = [Fraction(0)] * (len(x) + len(y) - 1)
    for (i, a), (j, b) in itertools.product(enumerate(x), enumerate(y)):
        result[i + j] += a * b
    return result


def _integral(x: Sequence[Fraction]) -> list[Fraction]:
    """Return the integral of a polynomial from 0 on."""
    return [Fraction(0), *(a / (k + 1) for k, a in enumerate(x))]


def level(taps: Sequence[Fraction], m: int, increments: int, previous: int, band: float) -> float:
    """Return an upper end of the largest distance of a filter's response from that of a Legendre coefficient.

    `taps`: weights of the samples, none for a coefficient that is not fitted. Rates are of amplitude 1 rad a sample and
    of angular frequencies up to `band`, in rad a sample.
    """
    from flint import arb, arb_poly, ctx

    turn = arb(band) * increments / 2
    if not taps and turn < m:  # (2 m + 1) j_m, which grows up to an argument above m
        with ctx.workprec(_BITS):
            size = (
                (2 * m + 1) * increments * (arb.pi() / (2 * turn)).sqrt() * turn.bessel_j(arb(2 * m + 1) / 2)
            )
            return math.nextafter(float(size.upper()), math.inf)
    middle = Fraction(increments, 2)
    edges = [Fraction(k) - middle for k in range(-previous, len(taps) - previous + 1)]
    half = Fraction(increments, 2)
    polynomial = rate_fit.legendre(m, Rational(1, 2))
    longest = max([abs(edge) for edge in (*edges, half)])
    with ctx.workprec(_BITS):
        beta, factorial = arb(band), 1
        parts: list[list[Any]] = [[], []]
        for n in range(_POWERS):
            factorial *= max(n, 1)
            wanted = (
                (2 * m + 1)
                * increments ** (n + 1)
                * sum(
                    (Fraction(int(c.p), int(c.q)) * _even_moment(n + k) for k, c in enumerate(polynomial)),
                    Fraction(0),
                )
            )
            fitted = sum(
                (
                    tap * (end ** (n + 1) - begin ** (n + 1)) / (n + 1)
                    for tap, begin, end in zip(taps, edges, edges[1:], strict=False)
                ),
                Fraction(0),
            )
            moment = (fitted - wanted) / factorial * (-1) ** (n // 2)
            for part in (0, 1):
                parts[part].append(_ball(moment) * beta**n if n % 2 == part else arb(0))
        # Moments of higher powers are at most those of weights without signs.
        weight = sum((abs(tap) for tap in taps), Fraction((2 * m + 1) * increments))
        rest = _ball(weight) * (_ball(longest) * beta) ** _POWERS / arb(_POWERS).fac() * 2
        largest = arb(0)
        polynomials = [arb_poly(part) for part in parts]
        half_part = arb(1) / (2 * _PARTS)
        for k in range(_PARTS):
            centre = arb_poly([arb(2 * k + 1) / (2 * _PARTS), 1])
            sizes = [
                sum((abs(c) * half_part**j for j, c in enumerate(p(centre).coeffs())), arb(0))
                for p in polynomials
            ]
            size = (sizes[0] ** 2 + sizes[1] ** 2).sqrt()
            largest = arb((size + rest).upper()).max(largest)
        return math.nextafter(float(largest.upper()), math.inf)


def _even_moment(n: int) -> Fraction:
    """Return the integral of t^n from -1/2 to 1/2."""
    return Fraction(0) if n % 2 else Fraction(1, 2**n * (n + 1))


def _ball(x: Fraction) -> Any:
    from strapgen.lab.certificate.balls import ball

    return ball(x)
