"""Coning coefficients that are shaped over a band of frequencies, in place of being exact at low ones.

The rotation vector is d_0 + ... + d_(N-1) + (sum_s K_s d_(N-1-s)) x d_(N-1); `coning_drift` has its drift E(b) on
coning of the angular frequency b in rad a sample. The weights K_s are those of the least mean square of E over the band
0 < b <= 1.3, which ends at a fifth of the sampling rate. They are rounded to multiples of 2^-60.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import mpmath
import sympy as sp

from strapgen.catalogue.methods.method import PHI, Method, exponential
from strapgen.catalogue.methods.samples import Samples, sample_names
from strapgen.kernel.algebra import cross, exact
from strapgen.kernel.kernel import KernelBuilder

SOURCE = "P. G. Savage, J. Guid. Control Dyn. 33 (2010), least squares over a band"
#: End of the band in rad, and digits of the arithmetic in which the weights are designed.
BAND, _DIGITS = Fraction(13, 10), 60
#: Bits after the binary point of a weight.
_BITS = 60


def method(order: int) -> Method:
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
        SOURCE,
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
