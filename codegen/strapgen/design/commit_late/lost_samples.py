"""Filters that restore a lost sample from those on both sides of it, with or without the sum of it and the next one.

The rate has no frequency above the band of a window, so that its increments are not independent: a lost one follows
from its neighbours within the band. The filter f makes the sum over `POINTS` frequencies b of the band of
|A_0(b)|^2 |sum_j f_j e^(ijb) - 1|^2 least, A_0 what a sample shows of the rate e^(ibt), with a small weight of the
squares of the taps. Their sum is 1, so that a constant rate is restored exactly. In 50 digits the taps come out alike
on every machine; they are rounded to multiples of 2^-60.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

from mpmath.ctx_mp import MPContext

from strapgen.catalogue.methods.window import GyroResponse, Taps, Window

#: Samples on each side of a lost one that restore it.
REACH = 8
#: Frequencies of the band over which the error is least in the mean, and the weight of the squares of the taps.
POINTS, WEIGHT = 400, Fraction(1, 10**16)
#: Binary digits of the taps behind the point.
_BITS = 60

_REAL = MPContext()
_REAL.dps = 50


class Restoration(NamedTuple):
    """The filters that restore a lost sample, the oldest tap first: those of samples -8 to 8, 0 the lost one."""

    #: The tap of the lost sample is 0
    lost: Taps
    #: Where the sum of the lost sample and the next one is known: both have the tap of the sum
    merged: Taps


def restoration(window: Window) -> Restoration:
    """Return the filters that restore a lost sample within the band of a window.

    >>> from strapgen.catalogue.methods.windows import WINDOWS
    >>> filters = restoration(WINDOWS["window-3-3"])
    >>> sum(filters.lost), sum(filters.merged), [round(float(tap), 4) for tap in filters.lost[8:]]
    (Fraction(1, 1), Fraction(1, 1), [0.0, 0.9129, -0.6925, 0.4323, -0.218, 0.086, -0.0251, 0.0049, -0.0005])
    """
    return _restoration(window.band, window.gyro)


@lru_cache(maxsize=8)
def _restoration(band: Fraction, gyro: GyroResponse | None) -> Restoration:
    points = [
        _number(band) * _REAL.cos(_REAL.pi * (2 * k + 1) / (4 * POINTS)) for k in range(POINTS)
    ]  # b = band cos(pi (k + 1/2) / 800)
    squares = [_square(b, gyro) for b in points]
    lags = [_REAL.fdot(squares, [_REAL.cos(lag * b) for b in points]) for lag in range(2 * REACH + 1)]
    outer = [(j,) for j in range(-REACH, REACH + 1) if j not in (0, 1)]
    return Restoration(_taps(lags, [(-j, j) for j in range(1, REACH + 1)]), _taps(lags, [*outer, (0, 1)]))


def _taps(lags: Sequence[Any], groups: Sequence[tuple[int, ...]]) -> Taps:
    """Return the taps of samples -8 to 8, alike in each group of samples, that leave the least sum of squares.

    The functions of two samples i and j have the product `lags[|i - j|]`; the sum of all taps is 1.
    """

    def product(group: Sequence[int], other: Sequence[int]) -> Any:
        return _REAL.fsum(lags[abs(i - j)] for i in group for j in other)

    count = len(groups)
    matrix, right = _REAL.zeros(count + 1), _REAL.zeros(count + 1, 1)
    for row, group in enumerate(groups):
        for column, other in enumerate(groups):
            matrix[row, column] = product(group, other)
        matrix[row, row] += _number(WEIGHT) * len(group)
        matrix[row, count] = matrix[count, row] = len(group)
        right[row] = product(group, (0,))
    right[count] = 1
    solution = _REAL.lu_solve(matrix, right)
    taps = [Fraction(int(_REAL.nint(_REAL.ldexp(solution[row], _BITS))), 1 << _BITS) for row in range(count)]
    # The largest tap takes up the rounding of the sum, a few units.
    largest = max(range(count), key=lambda row: abs(taps[row]))
    rest = sum((len(group) * tap for group, tap in zip(groups, taps, strict=True)), Fraction(0))
    taps[largest] += (1 - rest) / len(groups[largest])
    by_sample = {j: tap for group, tap in zip(groups, taps, strict=True) for j in group}
    return tuple(by_sample.get(j, Fraction(0)) for j in range(-REACH, REACH + 1))


def _square(b: Any, gyro: GyroResponse | None) -> Any:
    """Return |A_0|^2 at an angular frequency in rad a sample."""
    square = (_REAL.sin(b / 2) / (b / 2)) ** 2
    if gyro is None:
        return square
    ratio = b * _number(gyro.sample_hz) / (2 * _REAL.pi * _number(gyro.bandwidth_hz))
    return square / ((1 - ratio**2) ** 2 + (2 * _number(gyro.damping) * ratio) ** 2)


def _number(value: Fraction) -> Any:
    return _REAL.mpf(value.numerator) / value.denominator
