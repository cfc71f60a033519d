"""Gains that are computed before: a schedule by the Riccati recursion, steady gains by its doubling, in 70 digits.

The steady covariance is found by the structure-preserving doubling of E. K.-W. Chu, H.-Y. Fan and W.-W. Lin, A
structure-preserving doubling algorithm for continuous-time algebraic Riccati equations (2005) in its discrete form. The
recursion itself, in intervals around the result, proves what remains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath

from strapgen.ir.exceptions import InputError
from strapgen.ir.read_only import ReadOnly
from strapgen.navigation.kalman.kalman_model import FilterModel, combination, lasting, unseen

_DIGITS, _MOST_DOUBLINGS = 70, 60
#: An innovation variance below this part of what the states had at first is none.
_NO_VARIANCE = Fraction(1, 10**40)
#: Part of the covariance that a doubling may still change once it has converged.
_CONVERGED = Fraction(1, 10**50)
#: Largest part of the steady covariance that a period of measurements may change, and the digits to prove it in turn,
#: since intervals widen in every step of a long period.
_STEADY, _PROOF_DIGITS = Fraction(1, 10**30), (70, 280, 1120)

Rows = list[list[Any]]


@dataclass(frozen=True)
class Gains(ReadOnly):
    """Gains by the measurement, a row for each of its updates, one row if they are steady."""

    rows: Mapping[str, Sequence[Sequence[Fraction]]]
    #: Standard deviation of every state after the last step, or in the steady state after a measurement
    deviations: tuple[Fraction, ...]
    #: Largest change of the steady covariance by a step, by the deviations, proved in intervals; None for a schedule
    residual: Fraction | None = None


@cache
def _context() -> Any:
    context = mpmath.MPContext()
    context.dps = _DIGITS
    return context


class _Recursion:
    """The Riccati recursion in the numbers of a context of mpmath."""

    def __init__(self, model: FilterModel, number: Any) -> None:
        self.model, self.number, self.size = model, number, len(model.x)
        self.transition, self.noise = (self._rows(part) for part in (model.transition, model.Q))
        self.rows = self._rows(model.H)
        self.variances = [self._number(one.deviation**2) for one in model.text.measurements]
        self.used = [[k for k, entry in enumerate(row) if entry != 0] for row in self.transition]

    def _number(self, value: Fraction) -> Any:
        return self.number(value.numerator) / value.denominator

    def _rows(self, matrix: Any) -> Rows:
        return [[self.number(int(x.p)) / int(x.q) for x in matrix[i, :]] for i in range(matrix.rows)]

    def start(self) -> Rows:
        """Return the covariance before the first step."""
        rows = [[self.number(0)] * self.size for _ in range(self.size)]
        for k, one in enumerate(self.model.text.states):
            rows[k][k] = self._number(one.deviation**2)
        return rows

    def time_update(self, P: Rows) -> Rows:
        """Return Phi P Phi' + Q."""
        n, used, Phi = range(self.size), self.used, self.transition
        half = [[sum(Phi[i][k] * P[k][j] for k in used[i]) for j in n] for i in n]
        after = [[self.noise[i][j] for j in n] for i in n]
        for i in n:
            for j in range(i, self.size):
                after[i][j] = after[j][i] = self.noise[i][j] + sum(half[i][k] * Phi[j][k] for k in used[j])
        return after

    def update(self, place: int, P: Rows) -> tuple[Rows, list[Any], Any]:
        """Return the covariance after a measurement by its place, the gain, and the variance of the innovation."""
        n, h = range(self.size), self.rows[place]
        c = [sum(P[i][k] * h[k] for k in n if h[k] != 0) for i in n]
        S = sum(h[k] * c[k] for k in n if h[k] != 0) + self.variances[place]
        if not S > 0:
            return P, [], S
        K = [entry / S for entry in c]
        after = [list(row) for row in P]
        for i in n:
            for j in range(i, self.size):
                after[i][j] = after[j][i] = P[i][j] - K[i] * c[j]
        return after, K, S


def scheduled(model: FilterModel) -> Gains:
    """Return the gains of every step of the schedule."""
    text, context = model.text, _context()
    assert text.steps is not None
    for one in text.measurements:
        if one.every > text.steps:
            raise InputError(
                f"measurement[{one.name}].every is {one.every}; the schedule has {text.steps} steps"
            )
    recursion = _Recursion(model, context.mpf)
    P = recursion.start()
    rows: dict[str, list[list[Fraction]]] = {one.name: [] for one in text.measurements}
    least = [
        sum(h**2 * P[k][k] for k, h in enumerate(row)) * _NO_VARIANCE.numerator / _NO_VARIANCE.denominator
        for row in recursion.rows
    ]
    for step in range(1, text.steps + 1):
        P = recursion.time_update(P)
        for place, one in enumerate(text.measurements):
            if step % one.every == 0:
                P, gain, variance = recursion.update(place, P)
                if variance <= least[place]:
                    raise InputError(
                        f"measurement[{one.name}]: its innovation has no variance in step {step}, since its deviation "
                        "is 0 and the states in it are known already; a deviation above 0 is needed"
                    )
                rows[one.name].append([_fraction(number) for number in gain])
    return Gains(rows, _deviations(P))


def steady(model: FilterModel) -> Gains:
    """Return the gains to which the recursion converges, the same in every step."""
    text, context = model.text, _context()
    _require_steady(model)
    recursion = _Recursion(model, context.mpf)
    P = _matrix_rows(_doubled(model, recursion, context))
    before, gains = P, []
    for place, _ in enumerate(text.measurements):
        P, gain, _ = recursion.update(place, P)
        gains.append([_fraction(number) for number in gain])
    rows = {one.name: [gain] for one, gain in zip(text.measurements, gains, strict=True)}
    for digits in _PROOF_DIGITS:
        if (residual := _residual(model, before, digits)) <= _STEADY:
            return Gains(rows, _deviations(P), residual)
    first = text.measurements[0]
    raise InputError(
        f"measurement[{first.name}].every is {first.every}; over so many steps the steady gain is not proved to 30 "
        "digits, and fewer are needed"
    )


def _require_steady(model: FilterModel) -> None:
    """Refuse a filter whose gains do not become steady, or whose steady gains do not make it stable."""
    text, Phi = model.text, model.transition
    every = {one.every for one in text.measurements}
    if len(every) > 1:
        raise InputError(
            f"measurement[].every is {', '.join(map(str, sorted(every)))}; steady gains need the same for all, and "
            'kind = "scheduled" takes others'
        )
    if zero := [one.name for one in text.measurements if not one.deviation]:
        raise InputError(f"measurement[{zero[0]}].deviation is 0; a steady gain needs one above 0")
    names = [one.name for one in text.states]
    power = Phi ** every.pop()
    hidden = unseen(power, model.H)
    if lasting(power, hidden):
        texts = ", ".join(combination(names, vector) for vector in hidden)
        raise InputError(f"there is no steady gain: no measurement shows {texts}, which does not decay")
    still = unseen(Phi.T, model.Q)
    if lasting(Phi.T, still, above=False):
        texts = ", ".join(combination(names, vector) for vector in still)
        raise InputError(
            f"there is no steady gain above 0: no noise drives {texts}, which does not decay, and a filter in the end "
            "knows it; give it noise, or a schedule"
        )


def _doubled(model: FilterModel, recursion: _Recursion, context: Any) -> Any:
    """Return the steady covariance before a measurement, by doubling the number of steps."""
    text = model.text
    A, Q = context.matrix(recursion.transition), context.matrix(recursion.noise)
    power, noise = A, Q
    for _ in range(text.measurements[0].every - 1):
        power, noise = A * power, A * noise * A.T + Q
    H = context.matrix(recursion.rows)
    R = context.diag([1 / variance for variance in recursion.variances])
    A, G, X, unit = power.T, H.T * R * H, noise, context.eye(recursion.size)
    for _ in range(_MOST_DOUBLINGS):
        try:
            inverse = context.inverse(unit + G * X)
        except ZeroDivisionError:
            break
        change = A.T * X * inverse * A
        G, A = G + A * inverse * G * A.T, A * inverse * A
        X = X + change
        X = (X + X.T) / 2
        size = [context.sqrt(abs(X[k, k])) for k in range(recursion.size)]
        limit = context.mpf(_CONVERGED.numerator) / _CONVERGED.denominator
        if all(
            abs(change[i, j]) <= limit * size[i] * size[j]
            for i in range(recursion.size)
            for j in range(recursion.size)
        ):
            return X
    raise InputError("the Riccati equation does not converge to a steady gain")


def _residual(model: FilterModel, before: Rows, digits: int) -> Fraction:
    """Return a bound of the change of a covariance over a period of measurements, by the deviations, in intervals."""
    from mpmath import iv

    others, iv.dps = iv.dps, digits
    try:
        recursion = _Recursion(model, iv.mpf)
        P: Rows = [[iv.mpf(entry) for entry in row] for row in before]
        for place, _ in enumerate(model.text.measurements):
            P, _, _ = recursion.update(place, P)
        for _ in range(model.text.measurements[0].every):
            P = recursion.time_update(P)
        worst = Fraction(0)
        for i, row in enumerate(P):
            for j, entry in enumerate(row):
                size = iv.sqrt(iv.mpf(before[i][i]) * iv.mpf(before[j][j]))
                if size.a > 0:
                    part = abs(entry - iv.mpf(before[i][j])) / size
                    worst = max(worst, _raw(part._mpi_[1]))
        return worst
    finally:
        iv.dps = others


def _matrix_rows(matrix: Any) -> Rows:
    return [[matrix[i, j] for j in range(matrix.cols)] for i in range(matrix.rows)]


def _fraction(number: Any) -> Fraction:
    """Return a number of mpmath, exactly."""
    return _raw(number._mpf_)


def _raw(number: tuple[Any, ...]) -> Fraction:
    sign, mantissa, exponent, _ = number
    value = int(mantissa) * Fraction(2) ** int(exponent)
    return -value if sign else value


def _deviations(P: Rows) -> tuple[Fraction, ...]:
    context = _context()
    return tuple(_fraction(context.sqrt(abs(row[k]))) for k, row in enumerate(P))
