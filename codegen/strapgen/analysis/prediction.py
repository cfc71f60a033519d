"""The errors of a run as the series predict them: no step is taken."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import sympy as sp

from strapgen import algebra, catalogue, checks, exact
from strapgen.analysis.accumulation import antiderivative
from strapgen.analysis.error_rate import ErrorRate, error_rate
from strapgen.analysis.motion_rates import TIME, parameters
from strapgen.catalogue import Choice
from strapgen.convergence import interpreter
from strapgen.motions import Motion

#: A 3 x 3 matrix of mpmath, and the factor that it gains over a span of time.
Matrix = Any
Transfer = Callable[[Fraction, Fraction], Matrix]


@dataclass(frozen=True)
class Prediction:
    """Predicted errors of a run, in many digits.

    Parameters
    ----------
    times : list of mpf
        In s, the first one 0.
    errors : list of list of mpf
        Error matrices row by row, reference axes.
    scale, skew, drift : list of list of mpf
        Their parts on x, y, z.
    """

    times: list[Any]
    errors: list[list[Any]]
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

    The computed attitude is that of a body that turns at the true rate and the error rate together, in closed form; so
    products of errors, which matter at low orders, are in it, and so is what orthonormalization does.

    Parameters
    ----------
    choice : Choice
        An attitude step that is linear in its state.
    motion : Motion
    step, duration, orthonormalize, record : number
        As for `simulation.simulate`; without `record` the beginning and the end are given.
    terms : int, optional
        Powers of the step that are kept, from the first one on.

    Returns
    -------
    Prediction

    Raises
    ------
    InputError
        If the step has no closed form of a run, or a time is not allowed.

    Examples
    --------
    >>> from strapgen.motions import motion
    >>> found = predict(catalogue.choose("dcm", "rk1"), motion("constant", y_deg_s=10), "1/8", 180, 5)
    >>> round(float(mpmath.degrees(found.drift[-1][1])), 3)
    0.286
    """
    found = error_rate(choice, motion.name, terms)

    def transfer(h: Fraction) -> Transfer:
        settings = [mpmath.mpf(value) for value in motion.parameters.values()]
        return (_turning if found.steady else _about_an_axis)(found, settings, exact.number(h))

    return follow(choice, motion, transfer, step, duration, orthonormalize, record)


def follow(
    choice: Choice,
    motion: Motion,
    transfer: Callable[[Fraction], Transfer],
    step: float | str | Fraction,
    duration: float | str | Fraction,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
) -> Prediction:
    """Return the errors of a run whose error over any span of time is known, orthonormalized now and then.

    Parameters
    ----------
    choice : Choice
    motion : Motion
    transfer : callable
        For the step in s ``transfer(begin, end)``: the factor by which the product of computed and true matrix, the
        latter transposed, grows over a span.
    step, duration, orthonormalize, record : number
        As for `predict`.
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
    # Computed matrix = product * true matrix: the error matrix and the identity.
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
    """Return what splits the error of a computed matrix against a true one into scale, skew and drift.

    ``split(computed, true)``, both row by row: the outputs of the kernel error-matrix, in many digits.
    """
    kernel = interpreter("error-matrix")

    def split(computed: Sequence[Any], true: Sequence[Any]) -> tuple[list[Any], list[Any], list[Any]]:
        made = kernel.outputs(computed, true)
        return made["scale"], made["skew"], made["drift"]

    return split


def _sum(found: ErrorRate, matrices: dict[int, sp.Matrix], h: Any) -> Callable[..., Matrix]:
    """Return the sum of a series as a function of the motion's parameters, and of what else its terms depend on."""
    symbols = [*parameters(found.motion), TIME]
    made = {power: sp.lambdify(symbols, matrix, "mpmath") for power, matrix in matrices.items()}

    def value(*arguments: Any) -> Matrix:
        total = mpmath.zeros(3)
        for power, function in made.items():
            total += h**power * function(*arguments)
        return total

    return value


def _turning(found: ErrorRate, settings: list[Any], h: Any) -> Transfer:
    """Return what the product gains over a span of time where the frame turns evenly."""
    axis = sp.lambdify(parameters(found.motion), algebra.skew(found.axis), "mpmath")(*settings)
    whole = axis + _sum(found, found.matrices, h)(*settings, mpmath.mpf(0))
    spans: dict[Fraction, Matrix] = {}

    def transfer(begin: Fraction, end: Fraction) -> Matrix:
        if end - begin not in spans:
            span = exact.number(end - begin)
            spans[end - begin] = mpmath.expm(whole * span) * mpmath.expm(-axis * span)
        turned = mpmath.expm(axis * exact.number(begin))
        return turned * spans[end - begin] * turned.T

    return transfer


def _about_an_axis(found: ErrorRate, settings: list[Any], h: Any) -> Transfer:
    """Return what the product gains over a span of time where the rate keeps its axis."""
    gained = {power: antiderivative(matrix, found) for power, matrix in found.matrices.items()}
    value = _sum(found, gained, h)

    def transfer(begin: Fraction, end: Fraction) -> Matrix:
        return mpmath.expm(value(*settings, exact.number(end)) - value(*settings, exact.number(begin)))

    return transfer


def _orthonormalization(choice: Choice) -> Callable[[Matrix], Matrix]:
    """Return what restores a computed matrix: the scheme of the algorithm, or the normalization of its parameters."""
    kernel = catalogue.derive(choice)
    companions = kernel.companions
    assert companions is not None, "checked by error_rate"
    if companions.orthonormalize is None:
        return lambda computed: computed
    if companions.attitude is not None:
        # The matrix of parameters whose length is off is a rotation times a factor.
        return lambda computed: computed / mpmath.cbrt(mpmath.det(computed))
    scheme = interpreter(companions.orthonormalize, kernel)
    return lambda computed: _matrix(scheme(list(computed)))
