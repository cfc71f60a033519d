"""Predicts the errors of a run from the series of the error rate, without a simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import sympy as sp

from strapgen import pipeline
from strapgen.analysis.series.error_rate import ErrorRate, antiderivative, error_rate
from strapgen.analysis.series.motion_rates import TIME, parameters
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.kernel import algebra
from strapgen.lab.motions.motions import Motion
from strapgen.run import exact
from strapgen.run.exact import interpreter

#: A 3 x 3 matrix of mpmath, and the function that returns its growth factor from one time to another.
Matrix = Any
Transfer = Callable[[Fraction, Fraction], Matrix]


@dataclass(frozen=True)
class Prediction:
    """Predicted errors of a run in many digits, reference axes."""

    #: In s, the first one 0
    times: list[Any]
    #: Error matrices, row by row
    errors: list[list[Any]]
    #: Their parts on x, y, z; scale dimensionless, skew and drift in rad
    scale: list[list[Any]]
    skew: list[list[Any]]
    drift: list[list[Any]]

    @property
    def drift_by_axis(self) -> list[float]:
        """Largest magnitude of the drift on each axis, in rad."""
        return [max(abs(float(row[axis])) for row in self.drift) for axis in range(3)]

    @property
    def mean_drift(self) -> float:
        """Root of the sum of squares of `drift_by_axis`, in rad."""
        return float(mpmath.norm(self.drift_by_axis))


def predict(
    choice: Choice,
    motion: Motion,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
    terms: int = 2,
) -> Prediction:
    """Predict the errors of a run from the series of its error rate.

    The computed attitude is the closed form of a motion at the sum of the true rate and the error rate. It therefore
    includes products of errors, which matter at low orders, and the effect of orthonormalization.

    >>> from strapgen import choose, motion
    >>> prediction = predict(choose("dcm", "rk1"), motion("constant", y_deg_s=10), "1/8", 180, 5)
    >>> round(float(mpmath.degrees(prediction.drift[-1][1])), 3)
    0.286
    """
    transfers = transfers_of(error_rate(choice, motion.name, terms), motion)
    return follow(choice, motion, transfers, step, duration, orthonormalize, record)


def transfers_of(rates: ErrorRate, motion: Motion) -> Callable[[Fraction], Transfer]:
    """Return the growth of the error by an error rate, for steps of any length, as `follow` takes it."""
    compiled = _compiled(rates)

    def transfer(h: Fraction) -> Transfer:
        settings = [mpmath.mpf(value) for value in motion.parameters.values()]
        if rates.steady:
            return _turning(rates, compiled, settings, exact.number(h))
        return _about_an_axis(compiled, settings, exact.number(h))

    return transfer


def follow(
    choice: Choice,
    motion: Motion,
    transfer: Callable[[Fraction], Transfer],
    step: float | str | Fraction,
    duration: float | str | Fraction,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
) -> Prediction:
    """Return the errors of a run from the growth of its error between orthonormalizations.

    `transfer`: ``transfer(step)`` returns a function of two times in s, ``(begin, end)``, which returns the
    factor that the computed matrix times the transposed true one gains between them.
    """
    h = checks.number("step", step, positive=True)
    total = checks.number("duration", duration, positive=True)
    checks.multiple("duration", total, "step", h)
    interval = total if record is None else checks.number("record", record, positive=True)
    checks.multiple("record", interval, "step", h)
    checks.multiple("duration", total, "record interval", interval)
    every = total + interval
    if orthonormalize is not None:
        every = checks.number("orthonormalize", orthonormalize, positive=True)
        checks.multiple("orthonormalize", every, "step", h)
    with mpmath.workdps(exact.DIGITS):
        return _follow(choice, motion, transfer(h), total, every, interval)


def _follow(
    choice: Choice, motion: Motion, transfer: Transfer, total: Fraction, every: Fraction, interval: Fraction
) -> Prediction:
    settings = [[mpmath.mpf(value)] for value in motion.parameters.values()]
    truth = interpreter(f"{motion.name}-truth")

    def true(time: Fraction) -> Matrix:
        return _matrix(truth([exact.number(time)], *settings))

    restore = _orthonormalization(choice)
    split = parts_of()
    identity = list(mpmath.eye(3))
    stops = sorted(
        {k * interval for k in range(int(total / interval) + 1)}
        | {k * every for k in range(int(total / every) + 1)}
    )
    # The product is the computed matrix times the transposed true one: identity plus error matrix.
    product, before = mpmath.eye(3), Fraction(0)
    prediction = Prediction([], [], [], [], [])
    for time in stops:
        if time > before:
            product = product * transfer(before, time)
        if time and time % every == 0:
            product = restore(product * true(time)) * true(time).T
        if time % interval == 0:
            scale, skew, drift = split(list(product), identity)
            prediction.times.append(exact.number(time))
            prediction.errors.append(list(product - mpmath.eye(3)))
            prediction.scale.append(scale)
            prediction.skew.append(skew)
            prediction.drift.append(drift)
        before = time
    return prediction


def _matrix(elements: list[Any]) -> Matrix:
    return mpmath.matrix([elements[k : k + 3] for k in (0, 3, 6)])


def parts_of() -> Callable[[Sequence[Any], Sequence[Any]], tuple[list[Any], list[Any], list[Any]]]:
    """Return a function that splits the error of a computed matrix into scale, skew and drift.

    ``split(computed, true)`` takes both matrices row by row and runs the kernel error-matrix in many digits.
    """
    kernel = interpreter("error-matrix")

    def split(computed: Sequence[Any], true: Sequence[Any]) -> tuple[list[Any], list[Any], list[Any]]:
        results = kernel.outputs(computed, true)
        return results["scale"], results["skew"], results["drift"]

    return split


def _compiled(rates: ErrorRate) -> dict[int, Callable[..., Matrix]]:
    """Return the error rate, or about a fixed axis its integral, as functions of the motion's parameters and time."""
    symbols = [*parameters(rates.motion), TIME]
    matrices = rates.matrices
    if not rates.steady:
        matrices = {power: antiderivative(matrix, rates) for power, matrix in matrices.items()}
    return {power: sp.lambdify(symbols, matrix, "mpmath") for power, matrix in matrices.items()}


def _sum(compiled: dict[int, Callable[..., Matrix]], h: Any, arguments: list[Any]) -> Matrix:
    """Return the sum of a series."""
    total = mpmath.zeros(3)
    for power, function in compiled.items():
        total += h**power * function(*arguments)
    return total


def _turning(
    rates: ErrorRate, compiled: dict[int, Callable[..., Matrix]], settings: list[Any], h: Any
) -> Transfer:
    """Return the growth of the product between two times for a frame that turns at a constant rate."""
    axis = sp.lambdify(parameters(rates.motion), algebra.skew(rates.axis), "mpmath")(*settings)
    whole = axis + _sum(compiled, h, [*settings, mpmath.mpf(0)])
    spans: dict[Fraction, Matrix] = {}

    def transfer(begin: Fraction, end: Fraction) -> Matrix:
        if end - begin not in spans:
            span = exact.number(end - begin)
            spans[end - begin] = mpmath.expm(whole * span) * mpmath.expm(-axis * span)
        turned = mpmath.expm(axis * exact.number(begin))
        return turned * spans[end - begin] * turned.T

    return transfer


def _about_an_axis(compiled: dict[int, Callable[..., Matrix]], settings: list[Any], h: Any) -> Transfer:
    """Return the growth of the product between two times for a motion about a fixed axis."""

    @cache
    def gained(time: Fraction) -> Matrix:
        return _sum(compiled, h, [*settings, exact.number(time)])

    def transfer(begin: Fraction, end: Fraction) -> Matrix:
        return mpmath.expm(gained(end) - gained(begin))

    return transfer


def _orthonormalization(choice: Choice) -> Callable[[Matrix], Matrix]:
    """Return the function that orthonormalizes a computed matrix, by the scheme of the algorithm."""
    kernel = pipeline.derive(choice)
    step_kernels = kernel.attitude_step
    assert step_kernels is not None, "checked by error_rate"
    if step_kernels.orthonormalize is None:
        return lambda computed: computed
    if step_kernels.attitude is not None:
        # If the length of the parameters is not 1, their matrix is a rotation times a factor.
        return lambda computed: computed / mpmath.cbrt(mpmath.det(computed))
    scheme = interpreter(step_kernels.orthonormalize, pipeline.program(choice))
    return lambda computed: _matrix(scheme(list(computed)))
