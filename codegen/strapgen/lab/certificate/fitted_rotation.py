"""The exact rotation of the rate that a step fits to its samples, in balls.

The quaternion q of a rate w_0 + w_1 t + ... has a power series. About the middle of the step, where q = 1, its
coefficients are a_(n+1) = (a_n w_0 + a_(n-1) w_1 + ...)/(2 n + 2), the w times the step; the values at both ends give
the rotation between them. A series that leaves out products solves q' = q w/2 + r with these as r. As rotations keep
lengths, it errs by no more than the integral of |r|.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Rational

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.catalogue.methods.rate_fit import Fit
from strapgen.lab.certificate.balls import BITS, ball, column_of, evaluate_single, is_zero, product_in_pairs

Array = NDArray[np.float64]

#: The largest product that a series leaves out, and the largest that it has in double; a product in double, of factors
#: in double, errs by less than this part of its bound for each coefficient before it.
_LEFT_OUT, _IN_DOUBLE, _ROUNDING = 2.0**-80, 2.0**-32, 2.0**-48


class FittedRotation:
    """The rotation of a fitted rate as quaternions, scalar last."""

    def __init__(self, fit: Fit) -> None:
        from flint import arb_mat, ctx

        rows = [fit.taylor(power, Rational(1, 2)) for power in range(fit.degree + 1)]
        weights = [Fraction(int(x.p), int(x.q)) for row in rows for x in row]
        with ctx.workprec(BITS):
            self._weights = arb_mat(len(rows), len(rows[0]), [*map(ball, weights)])
        self._product = pipeline.program(choose("euler-product"))
        self._attitude = pipeline.program(choose("dcm-from-euler"))

    def rotations(self, samples: Array) -> list[Any]:
        """Return the rotations of blocks of steps.

        `samples` (K, n, samples, 3): increments in rad, exact. Returns the elements x, y, z, s, (K,) each.
        """
        blocks, steps, count, axes = samples.shape
        flat = samples.reshape(blocks * steps, count, axes)
        turns = self._of_steps(self.rates(flat))
        return product_in_pairs(self._product, [turn.reshape(blocks, steps) for turn in turns])

    def after(self, turn: Sequence[Any], other: Sequence[Any]) -> list[Any]:
        """Return the product of two rotations."""
        return evaluate_single(self._product, [*turn, *other])

    def matrix(self, turn: Sequence[Any]) -> Any:
        """Return the direction cosines of a rotation."""
        from flint import arb_mat

        return arb_mat(3, 3, evaluate_single(self._attitude, turn))

    def rates(self, samples: Array) -> list[list[Any]]:
        """Return the coefficients of the rate times the step by the power of time from the middle, in steps.

        `samples` (N, samples, 3). Returns for each power the components, (N,) each.
        """
        from flint import arb_mat

        steps, count, axes = samples.shape
        columns = arb_mat(count, steps * axes, samples.transpose(1, 0, 2).ravel().tolist())
        table = (self._weights * columns).table()
        powers = [np.array(row, object).reshape(steps, axes) for row in table]
        return [[*row.T] for row in powers]

    def _of_steps(self, rates: Sequence[Sequence[Any]]) -> list[Any]:
        """Return the rotation of each step."""
        from flint import arb

        # Time in halves of the step, from -1 to 1; a quaternion turns at half the rate.
        rates = [[x * arb(0.25) * arb(0.5) ** k for x in rate] for k, rate in enumerate(rates)]
        factors = [_Coefficient([*rate, 0], _largest(rate)) for rate in rates]
        one = np.full(len(rates[0][0]), arb(1), object)
        known, error = [_Coefficient([0, 0, 0, one], 1.0)], 0.0
        ends = [[*known[0].balls], [0] * 4]  # the sums of the even and of the odd coefficients
        while any(coefficient.bound for coefficient in known[-len(rates) :]):
            n = len(known)
            small, large, bound = [], [], 0.0
            for before, rate in zip(reversed(known), factors, strict=False):
                size = before.bound * rate.bound / n * (1 + 1e-9)
                if size < _LEFT_OUT:
                    error += size
                    continue
                bound += size
                if size < _IN_DOUBLE:
                    error += size * n * _ROUNDING
                    small.append(self.after(before.doubles, rate.doubles))
                else:
                    large.append(self.after(before.balls, rate.balls))
            known.append(_Coefficient.of(n, large, small, bound))
            if bound:
                ends[n % 2] = [_sum(pair) for pair in zip(ends[n % 2], known[n].balls, strict=True)]
        radius = arb(0, error * (1 + 1e-6))
        x, y, z, s = (e - o + radius for e, o in zip(*ends, strict=True))  # at the beginning
        end = [e + o + radius for e, o in zip(*ends, strict=True)]
        return [np.broadcast_to(turn, len(one)) for turn in self.after([-x, -y, -z, s], end)]


class _Coefficient:
    """A coefficient of a series: quaternions in balls, and in double, with a bound of their lengths."""

    def __init__(self, balls: list[Any], bound: float) -> None:
        self.balls, self.bound = balls, bound

    @cached_property
    def doubles(self) -> list[Any]:
        """The quaternions in double."""
        return [x if is_zero(x) else np.array([float(v) for v in x]) for x in self.balls]

    @classmethod
    def of(cls, n: int, large: list[Any], small: list[Any], bound: float) -> _Coefficient:
        """Return the sum of products in balls and in double, divided by n."""
        in_double: list[Any] = [_sum(some) for some in zip(*small, strict=True)] if small else [0] * 4
        in_double = [x if is_zero(x) else x / n for x in in_double]
        if not large:
            made = cls([x if is_zero(x) else column_of(x.tolist()) for x in in_double], bound)
            made.doubles = in_double
            return made
        sums = [_sum(some) for some in zip(*large, strict=True)]
        sums = [x if is_zero(x) or n == 1 else x / n for x in sums]
        return cls([_sum(pair) for pair in zip(sums, in_double, strict=True)], bound)


def _sum(parts: Sequence[Any]) -> Any:
    """Return a sum, without the zeros among its parts."""
    some = [part for part in parts if not is_zero(part)]
    return sum(some[1:], some[0]) if some else 0


def _largest(vectors: Sequence[Any]) -> float:
    """Return an upper end of the lengths of vectors, no more than a millionth above."""
    squares = np.zeros(1)
    for column in vectors:
        squares = squares + np.array([float(abs(x).upper()) for x in column]) ** 2
    return math.sqrt(float(np.max(squares))) * (1 + 1e-6)
