"""Frequency responses of the samples of a window over a band, in integers of `BITS` binary digits.

A filter F of the Legendre coefficient m has, at the angular frequency b in rad a sample and up to a factor of
modulus 1, the error  h(b) sum_j F_j e^{ibj} - i^m N (2m + 1) j_m(b N/2),  h = G(b) sin(b/2)/(b/2),  for each unit of
rate times the sampling interval; samples count from the middle of the step of N, j_m is the spherical Bessel function,
G the response of the gyro. The integers make a design the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from math import factorial, isqrt
from operator import mul
from typing import Any

from mpmath.ctx_mp import MPContext
from mpmath.libmp import mpf_shift, round_nearest, to_int

from strapgen.catalogue.methods.sensor_response import PI, Response

#: Binary digits behind the point of the integers, and the number 1 in them.
BITS = 320
ONE = 1 << BITS
#: Numbers of more digits than that, for what is no sum of products.
REAL = MPContext()
REAL.prec = BITS + 24

#: Frequencies of a mean, and of the search for a largest error.
MEAN_POINTS, SEARCH_POINTS = 400, 1200


def integer(value: Any) -> int:
    """Return the integer for a number: a fraction, a whole number or one of `REAL`."""
    if isinstance(value, Fraction):
        return (value.numerator << BITS) // value.denominator
    return int(to_int(mpf_shift(REAL.convert(value)._mpf_, BITS), round_nearest))


def real(value: int) -> Any:
    """Return the number of `REAL` for an integer."""
    return REAL.ldexp(REAL.mpf(value), -BITS)


class BandGrid:
    """Frequencies of a band, with the functions of the samples at each.

    `points`: b in rad a sample.

    >>> grid = BandGrid([REAL.mpf(1)], 2)
    >>> round(grid.cosines[0][2] / ONE, 6), round(grid.sines[0][2] / ONE, 6), round(grid.gains[0][0] / ONE, 6)
    (-0.416147, 0.909297, 0.958851)
    """

    def __init__(
        self, points: Sequence[Any], reach: int, gyro: Response | None = None, increments: int = 1
    ) -> None:
        self.points, self._increments = points, increments
        #: cos(jb) and sin(jb) for j from 0 to the reach, by frequency; from 1/2 on for even N.
        self.cosines: list[list[int]] = []
        self.sines: list[list[int]] = []
        #: cos(jb) for whole j.
        self.lags: list[list[int]] = []
        for b in points:
            cosine, sine = map(integer, REAL.cos_sin(b))
            self.lags.append(_recurrence(ONE, cosine, cosine, reach))
            if increments % 2:
                self.cosines.append(self.lags[-1])
                self.sines.append(_recurrence(0, sine, cosine, reach))
            else:
                first, second = (tuple(map(integer, REAL.cos_sin(b * k / 2))) for k in (1, 3))
                self.cosines.append(_recurrence(first[0], second[0], cosine, reach))
                self.sines.append(_recurrence(first[1], second[1], cosine, reach))
        #: h as real and imaginary part, by frequency.
        self.gains = [_gain(b, gyro) for b in points]
        self._bessel: dict[int, list[int]] = {}

    def bessel(self, m: int) -> list[int]:
        """Return N (2m + 1) j_m(b N/2) with the sign of i^m, or of i^(m-1) for odd m, by frequency."""
        if m not in self._bessel:
            number = self._increments
            factor = (-1) ** (m // 2) * (2 * m + 1) * number
            self._bessel[m] = [factor * _bessel_integer(m, integer(b) * number // 2) for b in self.points]
        return self._bessel[m]

    def squares(self) -> list[int]:
        """Return h squared in magnitude, by frequency."""
        return [(x * x + y * y) >> BITS for x, y in self.gains]

    def coning(self) -> list[int]:
        """Return what two rates of one frequency add to the rotation vector of a step, (sin bN - bN)/(2 b^2)."""
        turns = [self._increments * b for b in self.points]
        return [integer((REAL.sin(x) - x) * self._increments**2 / (2 * x * x)) if x else 0 for x in turns]

    def wanted(self, m: int) -> list[tuple[int, int]]:
        """Return the response that gives a Legendre coefficient, as real and imaginary part, by frequency."""
        return [(0, value) if m % 2 else (value, 0) for value in self.bessel(m)]

    def response(self, taps: Sequence[int], previous: int | None = None) -> list[tuple[int, int]]:
        """Return the response of taps as real and imaginary part, by frequency; by default as many on both sides."""
        if previous is None:
            previous = (len(taps) - self._increments) // 2
        result = []
        even, odd = _fold(taps, 2 * previous + self._increments - 1)
        for cosines, sines, (x, y) in zip(self.cosines, self.sines, self.gains, strict=True):
            c = sum(map(mul, even, cosines)) >> BITS
            s = sum(map(mul, odd, sines)) >> BITS
            result.append(((x * c - y * s) >> BITS, (x * s + y * c) >> BITS))
        return result

    def errors(
        self, m: int, taps: Sequence[int], previous: int, lever: Sequence[int] | None = None
    ) -> list[tuple[int, int]]:
        """Return the error of a filter as real and imaginary part, by frequency.

        With the taps v of a pair it is that of u times the conjugate of v, whose imaginary part is what drifts.
        """
        found, wanted = self.response(taps, previous), self.wanted(m)
        if lever is not None:
            pairs = zip(found, self.response(lever), strict=True)
            found = [((x * v + y * w) >> BITS, (y * v - x * w) >> BITS) for (x, y), (v, w) in pairs]
            wanted = [(0, value) for value in self.coning()]
        return [(x - re, y - im) for (x, y), (re, im) in zip(found, wanted, strict=True)]


def _fold(taps: Sequence[int], twice_middle: int) -> tuple[list[int], list[int]]:
    """Return the weights of cos(jb) and of sin(jb), j from 0 or 1/2, in a sum over samples on both sides."""
    reach = max(twice_middle, 2 * len(taps) - 2 - twice_middle) // 2
    even, odd = [0] * (reach + 1), [0] * (reach + 1)
    for place, tap in enumerate(taps):
        number, after = distance(place, twice_middle)
        even[number] += tap
        odd[number] += tap if after else -tap
    return even, odd


def distance(place: int, twice_middle: int) -> tuple[int, bool]:
    """Return the number of a sample by its distance from the middle of the step, and whether it is after that.

    >>> [distance(place, 4)[0] for place in range(5)], [distance(place, 3)[0] for place in range(4)]
    ([2, 1, 0, 1, 2], [1, 0, 0, 1])
    """
    twice = 2 * place - twice_middle
    return abs(twice) // 2, twice > 0


def _recurrence(first: int, second: int, cosine: int, reach: int) -> list[int]:
    """Return cosines or sines of the multiples of an angle."""
    values = [first, second]
    while len(values) <= reach:
        values.append((2 * cosine * values[-1] >> BITS) - values[-2])
    return values[: reach + 1]


def _gain(b: Any, gyro: Response | None) -> tuple[int, int]:
    sinc = _bessel_integer(0, integer(b) // 2)
    if gyro is None:
        return sinc, 0
    assert gyro.sample_hz is not None, "a window's has it"
    hertz = gyro.sample_hz / (2 * PI)
    response = REAL.mpc(real(sinc) * gyro.gain(b * hertz.numerator / hertz.denominator, REAL))
    return integer(response.real), integer(response.imag)


#: Largest argument of a Bessel function whose power series keeps its digits; a step of one sample has no larger one.
_SMALL = 2 * ONE


@lru_cache
def _series(m: int) -> tuple[Any, ...]:
    """Return the coefficients of x^(m + 2k) in j_m(x)."""
    coefficients = []
    k = 0
    while True:
        # (-1)^k / (2^k k! (2m + 2k + 1)!!), the double factorial by two factorials.
        n = m + k
        double_factorial = factorial(2 * n + 1) // (2**n * factorial(n))
        coefficients.append(REAL.mpf((-1) ** k) / (2**k * factorial(k) * double_factorial))
        if k > 8 and abs(coefficients[-1]) * 2 ** (2 * k) < REAL.ldexp(1, -BITS - 24):
            return tuple(coefficients)
        k += 1


@lru_cache
def _series_integers(m: int) -> tuple[int, ...]:
    return tuple(map(integer, _series(m)))


def _bessel_integer(m: int, x: int) -> int:
    """Return j_m(x), in integers."""
    if x > _SMALL:
        argument = real(x)
        return integer(REAL.sqrt(REAL.pi / (2 * argument)) * REAL.besselj(REAL.mpf(2 * m + 1) / 2, argument))
    square, value = x * x >> BITS, 0
    for c in reversed(_series_integers(m)):
        value = (value * square >> BITS) + c
    for _ in range(m):
        value = value * x >> BITS
    return value


def magnitude(re: int, im: int) -> int:
    """Return the magnitude of a complex number."""
    return isqrt(re * re + im * im)


def mean_points(band: Fraction) -> list[Any]:
    """Return the frequencies of a mean over a band: b = beta cos(pi (k + 1/2)/800)."""
    beta = REAL.mpf(band.numerator) / band.denominator
    count = MEAN_POINTS
    return [beta * REAL.cos(REAL.pi * (2 * k + 1) / (4 * count)) for k in range(count)]


def search_points(band: Fraction, count: int = SEARCH_POINTS) -> list[Any]:
    """Return the frequencies of a search, rising from 0 to the end of the band and closest there."""
    beta = REAL.mpf(band.numerator) / band.denominator
    return [beta * REAL.sin(REAL.pi * k / (2 * count)) for k in range(count + 1)]


@lru_cache(maxsize=8)
def mean_grid(band: Fraction, reach: int, gyro: Response | None, increments: int = 1) -> BandGrid:
    """Return the grid of a mean over a band."""
    return BandGrid(mean_points(band), reach, gyro, increments)


@lru_cache(maxsize=8)
def search_grid(
    band: Fraction, reach: int, gyro: Response | None, count: int = SEARCH_POINTS, increments: int = 1
) -> BandGrid:
    """Return the grid of a search for a largest error over a band."""
    return BandGrid(search_points(band, count), reach, gyro, increments)
