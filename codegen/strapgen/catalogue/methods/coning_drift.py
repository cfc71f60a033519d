"""The drift on coning of a step that crosses its newest sample with a weighted sum of older ones.

The rotation vector is sum_j d_j + (sum_s K_s d_(-s)) x d_0, where d_0 is the newest sample and d_(-s) lies s samples
before it. On a cone of half-angle alpha, seen through a gyro G, N samples a step, b = omega T, the drift is
alpha^2 E / (N T) with

    E(b) = H sum_s K_s 2 sin(s b) (1 - cos b) - (N b - H sin N b)/2,   H = |G|^2.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from math import factorial
from typing import Any, NamedTuple

from mpmath.ctx_mp import MPContext

from strapgen.catalogue.methods.sensor_response import PI, Response, product, quotient

#: Numbers of 60 digits: E cancels to 1e-20 of its terms and less.
_REAL = MPContext()
_REAL.dps = 60
#: Frequencies at which the largest drift of a band is searched.
_POINTS = 1200


class ConingShape(NamedTuple):
    """The samples and the gyro of a step, on which the drift on coning depends beside the coefficients."""

    increments: int  # N, of the step
    previous: int  # samples from before the step
    gyro: Response | None = None  # None for increments that are integrals of the rate

    @property
    def unknowns(self) -> int:
        """Number of coefficients K_s."""
        return self.increments + self.previous - 1


def terms(shape: ConingShape, b: Any, context: Any) -> tuple[list[Any], Any]:
    """Return dE/dK_s for every s, and minus E without coefficients, at b in rad a sample.

    >>> columns, right = terms(ConingShape(1, 1), _REAL.mpf(1), _REAL)
    >>> [round(float(value), 6) for value in (*columns, right)]
    [0.773645, 0.079265]
    """
    power = context.mpf(1)
    if shape.gyro is not None:
        assert shape.gyro.sample_hz is not None, "a shape's has it"
        hertz = shape.gyro.sample_hz / (2 * PI)
        power = abs(shape.gyro.gain(b * hertz.numerator / hertz.denominator, context)) ** 2
    factor = 2 * power * (1 - context.cos(b))
    columns = [factor * context.sin(s * b) for s in range(1, shape.unknowns + 1)]
    return columns, (shape.increments * b - power * context.sin(shape.increments * b)) / 2


def _inverse_power(gyro: Response | None, count: int) -> list[Fraction]:
    """Return the coefficients of 1, b^2, b^4, ... in 1/H."""
    if gyro is None:
        return [Fraction(int(not k)) for k in range(count)]
    ideal, own = (one.series(2 * count) for one in (Response(), gyro))
    inverse = quotient(ideal, own)
    mirrored = [c * (-1) ** k for k, c in enumerate(inverse)]
    # b^2 is -(ib)^2.
    return [c * (-1) ** k for k, c in enumerate(product(inverse, mirrored)[::2])]


def powers(shape: ConingShape, count: int) -> list[tuple[list[Fraction], Fraction]]:
    """Return the conditions on K_s that annul the lowest powers b^3, b^5, ... of E: weights and right side of each.

    >>> powers(ConingShape(1, 1), 1)
    [([Fraction(-6, 1)], Fraction(-1, 2))]
    """
    from strapgen.catalogue.methods.coning_coefficients import power_of_coning

    inverse = _inverse_power(shape.gyro, count + 1)
    conditions = []
    for q in range(1, count + 1):
        power, n = 2 * q + 1, Fraction(shape.increments)
        # The sum of K_s 2 sin(s b) (1 - cos b) is N b/(2 H) - sin(N b)/2.
        right = -(n**power) / 2 + n / 2 * (-1) ** q * factorial(power) * inverse[q]
        conditions.append(([power_of_coning(s, power) for s in range(1, shape.unknowns + 1)], right))
    return conditions


def products(shape: ConingShape, degree: int) -> list[tuple[list[Fraction], Fraction]]:
    """Return the conditions on K_s for exact products of two powers of time in the rate, up to a total degree.

    With an ideal gyro; those of degree 1 say the same as the first of `powers`.

    >>> [str(value) for row, value in products(ConingShape(1, 2), 2) for value in (*row, value)]
    ['1', '2', '1/12', '0', '-2', '1/12']
    """
    from strapgen.catalogue.methods.coning_coefficients import polynomial_conditions

    newest = shape.unknowns
    return [
        ([row[newest - s, newest] for s in range(1, newest + 1)], value)
        for total in range(1, degree + 1)
        for row, value in polynomial_conditions(shape.increments, shape.previous, total)
    ]


def largest(shape: ConingShape, coefficients: Sequence[Fraction], band: Fraction) -> float:
    """Return the largest |E| for K_1, K_2, ... over 0 < b <= band, both in rad.

    >>> f"{largest(ConingShape(1, 1), [Fraction(1, 12)], Fraction(1)):.3e}"
    '1.479e-02'
    """
    points, rows = _search(shape, band)
    values = [abs(value) for value in _sums(coefficients, rows)]
    peaks = [values[-1]]
    for k in range(1, _POINTS - 1):
        if values[k] >= max(values[k - 1], values[k + 1]):
            # The height of the parabola through the point and its neighbours.
            (x0, x1), (y0, y1) = (
                [points[place] - points[k] for place in (k - 1, k + 1)],
                [values[place] - values[k] for place in (k - 1, k + 1)],
            )
            curvature = (y1 / x1 - y0 / x0) / (x1 - x0)
            slope = y0 / x0 - curvature * x0
            peaks.append(values[k] - (slope * slope / (4 * curvature) if curvature else 0))
    return float(max(peaks))


@lru_cache(maxsize=2)
def _search(shape: ConingShape, band: Fraction) -> tuple[list[Any], list[tuple[list[Any], Any]]]:
    """Return the frequencies at which the largest drift of a band is searched, and the terms at each."""
    beta = _REAL.mpf(band.numerator) / band.denominator
    points = [beta * _REAL.sin(_REAL.pi * k / (2 * _POINTS)) for k in range(1, _POINTS + 1)]
    return points, [terms(shape, b, _REAL) for b in points]


def errors(shape: ConingShape, coefficients: Sequence[Fraction], points: Sequence[Any]) -> list[Any]:
    """Return E for K_1, K_2, ... at frequencies b in rad a sample.

    >>> [f"{float(value):.3e}" for value in errors(ConingShape(1, 1), [Fraction(1, 12)], [0.1, 0.2])]
    ['-1.665e-07', '-5.308e-06']
    """
    return _sums(coefficients, (terms(shape, _REAL.mpf(b), _REAL) for b in points))


def _sums(coefficients: Sequence[Fraction], rows: Iterable[tuple[list[Any], Any]]) -> list[Any]:
    """Return the sums of coefficients times columns, minus the right sides."""
    weights = [_REAL.mpf(c.numerator) / c.denominator for c in coefficients]
    return [_REAL.fdot(zip(weights, columns, strict=True)) - right for columns, right in rows]
