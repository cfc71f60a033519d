"""Predicts the errors of a run from the series of the error rate, and compares them with simulated errors.

An agreement runs an algorithm with smaller and smaller steps, both it and the prediction in many digits, so that
rounding does not hide a difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any

import mpmath
import sympy as sp

from strapgen import pipeline
from strapgen.analysis.series.error_rate import ErrorRate, antiderivative, error_rate
from strapgen.analysis.series.motion_rates import TIME, parameters
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel import algebra
from strapgen.lab.motions.motions import GENERAL, Motion
from strapgen.lab.runs import exact_attitudes, step_of_increments
from strapgen.results.table import SECONDS, Column, TextTable
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
    compiled = _compile(rates)

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


def _compile(rates: ErrorRate) -> dict[int, Callable[..., Matrix]]:
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


@dataclass(frozen=True)
class StepAgreement:
    """Predicted and simulated drift for one step length."""

    step_s: float
    #: In s
    times: list[float]
    #: Drift on x, y, z at each time, in rad
    simulated: list[list[float]]
    predicted: list[list[float]]
    #: Largest simulated drift, in rad
    drift: float
    #: Largest difference of predicted and simulated drift, in rad
    difference: float


@dataclass(frozen=True)
class Agreement:
    """Predicted and simulated drift for a sequence of step lengths."""

    kernel: str
    motion: str
    #: Number of powers of the step in the prediction
    terms: int
    #: The first power of the error rate; None if there is no error
    order: int | None
    #: One for each step length, from the longest to the shortest
    rungs: tuple[StepAgreement, ...]

    @property
    def slopes(self) -> list[float]:
        """Slope of the difference against the step in a log-log plot, from each step to the next."""
        return [
            math.log(long.difference / short.difference) / math.log(long.step_s / short.step_s)
            for long, short in pairwise(self.rungs)
            if long.difference and short.difference
        ]


def agreement(
    choice: Choice,
    motion: Motion,
    steps: Sequence[float | str | Fraction],
    duration: float | str | Fraction,
    terms: int = 2,
) -> Agreement:
    """Compare predicted with simulated drift.

    `steps`: steps in s; each divides the longest one, and that divides the duration. `duration`: in s.

    >>> from strapgen import catalogue
    >>> from strapgen.lab.motions.motions import motion
    >>> turn = motion("constant", y_rad_s=1)
    >>> found = agreement(catalogue.choose("dcm", "rk2", 1), turn, ["1/8", "1/16"], 1, terms=1)
    >>> found.order, round(found.slopes[0], 1)
    (2, 4.0)
    """
    kernel = step_of_increments(choice)
    total = checks.number("duration", duration, positive=True)
    lengths = sorted({checks.number("step", step, positive=True) for step in steps}, reverse=True)
    if not lengths:
        raise InputError("at least one step is needed")
    longest = lengths[0]
    checks.multiple("duration", total, "step", longest)
    for length in lengths:
        checks.multiple("the longest step", longest, "step", length)
    run = exact_attitudes(choice, motion)
    rates = error_rate(choice, motion.name, terms)
    transfers = transfers_of(rates, motion)
    rungs = []
    for length in lengths:
        every = checks.multiple("the longest step", longest, "step", length)
        expected = follow(choice, motion, transfers, length, total, record=longest)
        with mpmath.workdps(exact.DIGITS):
            split = parts_of()
            states = list(run(length, int(total / length)))[::every]
            drifts = [split(computed, true)[2] for computed, true in states]
            rungs.append(_at_step(length, expected, drifts))
    return Agreement(kernel.name, motion.name, terms, rates.order, tuple(rungs))


def _at_step(length: Fraction, expected: Prediction, drifts: list[list[Any]]) -> StepAgreement:
    rows = list(zip(expected.drift, drifts, strict=True))
    return StepAgreement(
        float(length),
        [float(time) for time in expected.times],
        [[float(x) for x in row] for row in drifts],
        [[float(x) for x in row] for row in expected.drift],
        float(max(abs(x) for row in drifts for x in row)),
        float(max(abs(a - b) for one, other in rows for a, b in zip(one, other, strict=True))),
    )


#: Default parameters of the motions, with rates of about 1 rad/s.
SETTINGS: dict[str, dict[str, str]] = {
    "constant": {"x_rad_s": "0.5", "y_rad_s": "0.7", "z_rad_s": "-0.3"},
    "sinusoidal": {"a_rad_s": "1", "b_rad_s": "1.5"},
    "coning": GENERAL,
    "polynomial": {"a0": "30", "a1": "40", "a2": "-20", "a3": "10", "a4": "5"},
}


def default_steps(choice: Choice) -> tuple[str, ...]:
    """Return steps in s, halved from one to the next, on which the term after the predicted ones can be seen."""
    return (
        ("1/4", "1/8", "1/16", "1/32") if choice.increments_per_step > 4 else ("1/8", "1/16", "1/32", "1/64")
    )


_COLUMNS = (
    Column("step, s", spec=SECONDS, least=12),
    Column("simulated", spec=".4e", least=12),
    Column("difference", spec=".4e", least=12),
    Column("relative", spec=".1e", least=9),
    Column("slope", "<", ".2f", missing=""),
)


def agreement_text(agreement: Agreement) -> str:
    """Return the agreement as a table: a row for every step length."""
    slopes: list[float | None] = [None, *agreement.slopes]
    slopes += [None] * (len(agreement.rungs) - len(slopes))
    rows = [
        (
            rung.step_s,
            rung.drift,
            rung.difference,
            rung.difference / rung.drift if rung.drift else None,
            slope,
        )
        for rung, slope in zip(agreement.rungs, slopes, strict=True)
    ]
    title = (
        f"{agreement.kernel}, {agreement.motion} motion: drift in rad, "
        f"simulated and predicted by {agreement.terms} terms"
    )
    return f"{title}\n{TextTable(_COLUMNS, rows).as_text()}"
