"""`RateMotion` is a motion whose body rate is an expression; angles and attitude are integrated from it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from operator import mul
from typing import Any

import numpy as np
from mpmath import iv, mp
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.rate_expressions import SLACK, Jets, Operation, UnboundedError, operations_of

Array = NDArray[np.float64]

#: Digits of the arithmetic, and the degree of the polynomials of the rate and of the attitude.
DIGITS, RATE_DEGREE, ATTITUDE_DEGREE = 50, 32, 36
#: Largest error of the integral of the rate over a piece, and of the attitude, in rad; the attitude ends in double.
ANGLE_TOLERANCE, ATTITUDE_TOLERANCE = 1e-40, 1e-25
#: What rounding adds to the error of a piece: fewer than 10^5 roundings to 50 digits, of values below 10^4.
ROUNDING = 1e-41
#: Longest half of a piece in s, and the shortest one; a rate that needs shorter ones counts as one without a bound.
LONGEST_HALF, SHORTEST_HALF = 4, 2**-16
#: Most pieces of a run in one direction.
MOST_PIECES = 50_000


@dataclass(frozen=True)
class RateMotion(Motion):
    """A motion of a rate expression.

    >>> from strapgen.lab.motions.rate_expressions import time_symbol
    >>> turn = RateMotion("turn", {}, (0 * time_symbol(), 0 * time_symbol(), time_symbol()))
    >>> turn.samples(Fraction(1), 0, 2)[:, 2], turn.error_bound(2.0) < 1e-25
    (array([0.5, 1.5]), True)
    """

    #: The body rate in rad/s as expressions of `expressions.time_symbol`
    elements: tuple[Any, ...] = field(default=())

    @cached_property
    def _integrate(self) -> IntegratedRate:
        return IntegratedRate(self.name, *operations_of(self.name, self.elements))

    def error_bound(self, time: float) -> float:
        """Return a proved bound of the error of the attitude at a time in s, before it is rounded, in rad."""
        with mp.workdps(DIGITS):
            return self._integrate.piece(_number(time)).error

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return angle increments of some sampling intervals, integrated in 50 digits, see `Motion.samples`."""
        rows = [[float(x) for x in row] for row in self.samples_in_digits(interval, first, stop)]
        return np.array(rows, float).reshape(stop - first, 3)

    def samples_in_digits(self, interval: Fraction, first: int, stop: int) -> list[list[Any]]:
        """Return the increments of `samples` in 50 digits, before rounding: (stop - first) rows of three."""
        with mp.workdps(DIGITS):
            edges = [_time(k * interval) for k in range(first, stop + 1)]
            angles = [self._integrate.piece(edge).angle_at(edge) for edge in edges]
            return [[b - a for a, b in zip(*pair, strict=True)] for pair in pairwise(angles)]

    def attitude(self, time: Any) -> Array:
        """Return the true attitude, see `Motion.attitude`."""
        return self._at(time, _attitude_elements, (3, 3))

    def attitude_in_digits(self, time: Fraction) -> list[Any]:
        """Return the true attitude at a time in s before it is rounded, row by row, within `error_bound`."""
        with mp.workdps(DIGITS):
            moment = _time(time)
            return _attitude_elements(self._integrate.piece(moment), moment)

    def rate(self, time: Any) -> Array:
        """Return the body rate, see `Motion.rate`."""
        return self._at(time, lambda piece, t: piece.rate_at(t), (3,))

    def _at(
        self, time: Any, function: Callable[[_Piece, Any], Iterable[Any]], shape: tuple[int, ...]
    ) -> Array:
        """Return the values of a function of a piece and a time in it, at an array of times."""
        times = np.asarray(time, float)
        if not np.isfinite(times).all():
            raise InputError(f"{self.name}: a time is not finite")
        with mp.workdps(DIGITS):
            exact = map(_number, times.ravel().tolist())
            rows = [[float(x) for x in function(self._integrate.piece(t), t)] for t in exact]
        return np.array(rows, float).reshape(*times.shape, *shape)


def _attitude_elements(piece: _Piece, time: Any) -> list[Any]:
    """Return the attitude at a time in a piece, row by row; what is below the bound of its error is zero."""
    return [x if abs(x) > piece.error else mp.mpf(0) for row in piece.attitude_at(time) for x in row]


def _time(time: Fraction) -> Any:
    return mp.mpf(time.numerator) / time.denominator


def _number(time: float) -> Any:
    return mp.mpf(time)


@dataclass(frozen=True)
class _Piece:
    """An interval of time with the Taylor coefficients of rate and attitude."""

    #: Middle and half the length, in s
    middle: Any
    half: Any
    #: For each axis the Taylor coefficients of the rate about the middle
    rate: list[list[Any]]
    #: Integral of the rate from time 0 to the middle, in rad
    angle: list[Any]
    #: For each element the Taylor coefficients of the attitude about the middle, from no rotation there
    transition: list[list[list[Any]]]
    #: Attitude at the middle
    attitude: list[list[Any]]
    #: Bounds of the errors in rad of the integral and of the attitude, at both ends and between them
    angle_error: float
    error: float
    #: Whether a piece of twice the length is likely to do
    may_grow: bool

    def angle_at(self, time: Any) -> list[Any]:
        """Return the integral of the rate from time 0 to a time in the piece."""
        x = time - self.middle
        return [a + x * mp.polyval(row, x) for a, row in zip(self.angle, self._integral, strict=True)]

    @cached_property
    def _integral(self) -> list[list[Any]]:
        return _integrate(self.rate)

    def rate_at(self, time: Any) -> list[Any]:
        """Return the rate at a time in the piece."""
        return [mp.polyval(row[::-1], time - self.middle) for row in self.rate]

    def attitude_at(self, time: Any) -> list[list[Any]]:
        """Return the attitude at a time in the piece, row by row."""
        return _product(self.attitude, _series_at(self.transition, time - self.middle))


# Integrates a rate and the attitude that follows from it, with proved bounds of the error.
#
# Time is cut into pieces. About the middle of each the rate is a Taylor polynomial in 50 digits; a bound of the next
# Taylor coefficient over the whole piece bounds what it leaves out. For the polynomial the attitude has a Taylor
# series by (k + 1) C_(k+1) = sum_j C_j skew(w_(k-j)), whose remainder is that of its majorant, exp(sum_j |w_j|
# t^(j+1)/(j + 1)). A rotation keeps lengths, so that an error of the rate, in rad/s, times the time bounds that of
# the attitude in rad.


class IntegratedRate:
    """The integral of a rate, and the attitude, from time 0 as far as they are needed, forwards and backwards.

    `places`: the operations that are the three elements of the rate in rad/s.
    """

    def __init__(self, name: str, operations: list[Operation], places: list[int]) -> None:
        self._name, self._operations, self._places = name, operations, places
        self._pieces: dict[int, list[_Piece]] = {1: [], -1: []}
        self._ends: dict[int, list[Any]] = {1: [], -1: []}

    def piece(self, time: Any) -> _Piece:
        """Return the piece that holds a time; pieces up to it are added where they are missing."""
        direction = 1 if time >= 0 else -1
        pieces, ends = self._pieces[direction], self._ends[direction]
        while not ends or ends[-1] < abs(time):
            self._extend(direction)
        return pieces[min(bisect_right(ends, abs(time)), len(pieces) - 1)]

    def _extend(self, direction: int) -> None:
        """Add the next piece on one side of time 0."""
        pieces, ends = self._pieces[direction], self._ends[direction]
        if len(pieces) >= MOST_PIECES:
            raise InputError(
                f"{self._name}: the rate needs more than {MOST_PIECES} pieces, up to {float(ends[-1]):.6g} s"
            )
        begin = ends[-1] if ends else mp.mpf(0)
        half = mp.mpf(LONGEST_HALF)
        if pieces:
            half = min(half, pieces[-1].half * (2 if pieces[-1].may_grow else 1))
        with mp.workdps(DIGITS):
            while half >= SHORTEST_HALF:
                piece = self._piece(direction * (begin + half), half, direction, pieces)
                if piece is not None:
                    pieces.append(piece)
                    ends.append(begin + 2 * half)
                    return
                half = half / 2
        raise InputError(
            f"{self._name}: the rate has no bound, or no smooth course, near t = {float(direction * begin):.3f} s"
        )

    def _piece(self, middle: Any, half: Any, direction: int, before: list[_Piece]) -> _Piece | None:
        """Return a piece that continues those before it; None if its error is too large."""
        try:
            bounds = Jets(RATE_DEGREE + 1, True).evaluated(self._operations, _interval(middle, half))
            rest = math.hypot(*(float(bounds[place].coefficients[-1]) for place in self._places)) * SLACK
            missed = 2 * half * (mp.mpf(rest) * half ** (RATE_DEGREE + 1))
            if not missed <= ANGLE_TOLERANCE:
                return None
            jets = Jets(RATE_DEGREE, False).evaluated(self._operations, middle)
        except (UnboundedError, OverflowError):
            return None
        rate = [[mp.mpf(c) for c in jets[place].coefficients] for place in self._places]
        lengths = [mp.sqrt(sum(row[k] ** 2 for row in rate)) for k in range(RATE_DEGREE + 1)]
        series = _remainder(lengths, half)
        if not series <= ATTITUDE_TOLERANCE:
            return None
        transition = _transition(rate, half)
        edge = -direction * half  # where it meets the piece before it
        turned, gained = (
            _series_at(transition, edge),
            [edge * mp.polyval(row, edge) for row in _integrate(rate)],
        )
        if before:
            angle, attitude = before[-1].angle_at(middle + edge), before[-1].attitude_at(middle + edge)
        else:
            angle, attitude = [mp.mpf(0)] * 3, _identity()
        errors = (before[-1].angle_error, before[-1].error) if before else (0.0, 0.0)
        may_grow = missed * 2 ** (RATE_DEGREE + 2) < ANGLE_TOLERANCE
        may_grow = may_grow and series * 2 ** (ATTITUDE_DEGREE + 1) < ATTITUDE_TOLERANCE
        angle = [start - more for start, more in zip(angle, gained, strict=True)]
        inverse = [list(column) for column in zip(*turned, strict=True)]
        return _Piece(
            middle,
            half,
            rate,
            angle,
            transition,
            _product(attitude, inverse),
            # To the middle and on to the other end; the polynomial is turned back and forth, each with its remainder.
            errors[0] + 2 * float(missed) + ROUNDING,
            errors[1] + 2 * float(missed) + 2 * float(series) + ROUNDING,
            may_grow,
        )


def _interval(middle: Any, half: Any) -> Any:
    """Return an interval of double precision that holds a piece."""
    low, high = float(middle - half), float(middle + half)
    return iv.mpf([math.nextafter(low, -math.inf), math.nextafter(high, math.inf)])


def _remainder(lengths: list[Any], half: Any) -> Any:
    """Return a bound of the remainder of the attitude series, from the lengths of the rate's coefficients."""
    majorant, angle, power = [mp.mpf(1)], mp.mpf(0), mp.mpf(1)
    for k in range(ATTITUDE_DEGREE):
        known = range(max(0, k - RATE_DEGREE), k + 1)
        majorant.append(mp.fdot((majorant[j], lengths[k - j]) for j in known) / (k + 1))
    for j, length in enumerate(lengths):
        angle += length * half ** (j + 1) / (j + 1)
    total = mp.mpf(0)
    for coefficient in majorant:
        total += coefficient * power
        power *= half
    # Both are known to 50 digits, and the difference of them is far above that.
    return max(mp.exp(angle) - total, mp.mpf(0)) + mp.exp(angle) * mp.mpf(10) ** (5 - DIGITS)


def _transition(rate: list[list[Any]], half: Any) -> list[list[list[Any]]]:
    """Return the Taylor coefficients of each element of the attitude about the middle of a piece.

    They are computed in integers, in units of 2^-bits of what each adds at the end of the piece, whose half is a power
    of two.
    """
    bits, exponent = mp.prec, mp.frexp(half)[1] - 1
    scaled = [[int(mp.ldexp(c, bits + exponent * (k + 1))) for k, c in enumerate(row)] for row in rate]
    opposite = [[-c for c in row] for row in scaled]
    rows = [[[int(i == axis) << bits] for axis in range(3)] for i in range(3)]
    for k in range(ATTITUDE_DEGREE):
        first, last = max(0, k - RATE_DEGREE), k + 1
        for row in rows:
            known = [column[first:last] for column in row]
            for axis, column in enumerate(row):
                # A row times the skew matrix of the rate.
                after, next_after = (axis + 1) % 3, (axis + 2) % 3
                total = sum(map(mul, known[after], scaled[next_after][k - first :: -1]))
                total += sum(map(mul, known[next_after], opposite[after][k - first :: -1]))
                column.append((total >> bits) // (k + 1))
    return [
        [[mp.ldexp(c, -bits - exponent * k) for k, c in enumerate(column)] for column in row] for row in rows
    ]


def _integrate(rate: list[list[Any]]) -> list[list[Any]]:
    """Return the coefficients of the integral of a polynomial rate, without the factor of time, the highest first."""
    return [[c / (k + 1) for k, c in enumerate(row)][::-1] for row in rate]


def _series_at(series: list[list[list[Any]]], x: Any) -> list[list[Any]]:
    """Evaluate a matrix of Taylor series at a time after their origin."""
    powers = [mp.mpf(1)]
    for _ in range(ATTITUDE_DEGREE):
        powers.append(powers[-1] * x)
    return [[mp.fdot(column, powers) for column in row] for row in series]


def _product(left: list[list[Any]], right: list[list[Any]]) -> list[list[Any]]:
    return [[sum(left[i][k] * right[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def _identity() -> list[list[Any]]:
    return [[mp.mpf(int(i == j)) for j in range(3)] for i in range(3)]
