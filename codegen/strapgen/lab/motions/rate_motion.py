"""`RateMotion` is a motion whose body rate is an expression: all else is integrated from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from mpmath import mp
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.rate_expressions import operations_of
from strapgen.lab.motions.rate_integration import DIGITS, Integrated, Piece

Array = NDArray[np.float64]


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
    def _integrated(self) -> Integrated:
        return Integrated(self.name, *operations_of(self.name, self.elements))

    def error_bound(self, time: float) -> float:
        """Return a proved bound of the error of the attitude at a time in s, before it is rounded, in rad."""
        with mp.workdps(DIGITS):
            return self._integrated.piece(_number(time)).error

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return angle increments of some sampling intervals, integrated in 50 digits, see `Motion.samples`."""
        rows = [[float(x) for x in row] for row in self.samples_in_digits(interval, first, stop)]
        return np.array(rows, float).reshape(stop - first, 3)

    def samples_in_digits(self, interval: Fraction, first: int, stop: int) -> list[list[Any]]:
        """Return what `samples` does before it is rounded, integrated in 50 digits: (stop - first) rows of three."""
        with mp.workdps(DIGITS):
            edges = [_time(k * interval) for k in range(first, stop + 1)]
            angles = [self._integrated.piece(edge).angle_at(edge) for edge in edges]
            return [[b - a for a, b in zip(*pair, strict=True)] for pair in pairwise(angles)]

    def attitude(self, time: Any) -> Array:
        """Return the true attitude, see `Motion.attitude`."""
        return self._at(time, _attitude_elements, (3, 3))

    def attitude_in_digits(self, time: Fraction) -> list[Any]:
        """Return the true attitude at a time in s before it is rounded, row by row, within `error_bound`."""
        with mp.workdps(DIGITS):
            moment = _time(time)
            return _attitude_elements(self._integrated.piece(moment), moment)

    def rate(self, time: Any) -> Array:
        """Return the body rate, see `Motion.rate`."""
        return self._at(time, lambda piece, t: piece.rate_at(t), (3,))

    def _at(
        self, time: Any, function: Callable[[Piece, Any], Iterable[Any]], shape: tuple[int, ...]
    ) -> Array:
        """Return the values of a function of a piece and a time in it, at an array of times."""
        times = np.asarray(time, float)
        if not np.isfinite(times).all():
            raise InputError(f"{self.name}: a time is not finite")
        with mp.workdps(DIGITS):
            exact = map(_number, times.ravel().tolist())
            rows = [[float(x) for x in function(self._integrated.piece(t), t)] for t in exact]
        return np.array(rows, float).reshape(*times.shape, *shape)


def _attitude_elements(piece: Piece, time: Any) -> list[Any]:
    """Return the attitude at a time in a piece, row by row; what is below the bound of its error is zero."""
    return [x if abs(x) > piece.error else mp.mpf(0) for row in piece.attitude_at(time) for x in row]


def _time(time: Fraction) -> Any:
    return mp.mpf(time.numerator) / time.denominator


def _number(time: float) -> Any:
    return mp.mpf(time)
