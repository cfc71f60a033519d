"""The error rate is the rate that an algorithm in effect adds to the angular rate, as a series in the step length.

A run of an algorithm is the exact motion of a slightly different rate. If the rate of a motion has a constant length
and rotates uniformly (constant rate, coning), all steps are equal in a frame that rotates with it. With the matrix M of
the step at time 0 and the rotation R of the frame in a step, the N-th computed matrix is (M R')^N R^N, and
log(M R')/h = W + error rate, where W is the skew matrix of the rate of the frame. If the axis of the rate is fixed, all
matrices commute and the logarithms of the error matrices add up; the formula of Euler and Maclaurin turns their sum
into an integral over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen.analysis.series import motion_rates
from strapgen.analysis.series.invariants import invariants
from strapgen.analysis.series.motion_rates import TIME
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.kernel import algebra
from strapgen.kernel.covariants import NotCovariantError
from strapgen.kernel.power_series import Powers
from strapgen.lab import one_step
from strapgen.lab.one_step import Step

_Matrix = list[list[Powers]]


@dataclass(frozen=True)
class ErrorRate:
    """The rate that an algorithm in effect adds to the angular rate of a motion."""

    kernel: str
    motion: str
    #: Rate of the rotating frame in rad/s, reference axes; for a motion about a fixed axis, the rate at time t
    axis: sp.Matrix
    #: True if the error rate is constant in the rotating frame (constant rate and coning); otherwise it is a
    #: function of the time t, about a fixed axis
    steady: bool
    #: Coefficients by power of the step length, in 1/s; for a steady motion in the axes of time 0
    matrices: dict[int, sp.Matrix]
    #: Ring of the coefficients of a steady motion
    ring: Any = None
    #: For a steady motion the sum of the skew matrix of `axis` and the error rate, times the step, in that ring
    raw: tuple[tuple[Powers, ...], ...] = ()

    @property
    def order(self) -> int | None:
        """The first power that is not zero; None if there is none."""
        return min(self.matrices, default=None)


def error_rate(choice: Choice, motion: str, terms: int = 2) -> ErrorRate:
    """Derive the error rate of a step on a motion.

    >>> from strapgen import catalogue
    >>> found = error_rate(catalogue.choose("dcm", "rk1", 1), "sinusoidal")
    >>> found.order, found.matrices[1][0, 0]
    (1, a**2*cos(b*t)**2/2)
    """
    attitude_step = one_step.linear_step(choice)
    order = attitude_step.kernel.order
    try:
        if choice.user_kernel is not None:
            _require_covariance(attitude_step)
        top = 1 + (order.step if order else 1) + terms
        most = top + one_step.PATIENCE
        while True:
            rates = _rate(attitude_step, motion, top)
            if rates.order is not None and rates.order + terms <= top:
                break
            if top >= most:
                break
            top += 1
    except ArithmeticError as error:
        raise InputError(
            f"kernel {attitude_step.kernel.name} has no series in the step length: {error}"
        ) from None
    except NotCovariantError:
        raise InputError(
            f"kernel {attitude_step.kernel.name} does not turn with its inputs: "
            "what it loses in a run depends on the axes"
        ) from None
    if rates.order is None:
        return rates
    last = rates.order + terms
    leading = {power: matrix for power, matrix in rates.matrices.items() if power < last}
    return ErrorRate(rates.kernel, motion, rates.axis, rates.steady, leading, rates.ring, rates.raw)


def _rate(attitude_step: Step, motion: str, top: int) -> ErrorRate:
    if motion_rates.model(motion).turning is not None:
        return _steady(attitude_step, motion, top)
    return _about_an_axis(attitude_step, motion, top)


def _steady(attitude_step: Step, motion: str, top: int) -> ErrorRate:
    """Return the error rate of a motion whose rate rotates uniformly, up to the power top - 1."""
    symbols = motion_rates.parameters(motion)
    rate = motion_rates.at_start(motion, top, attitude_step.domain)
    ring = rate.ring
    model = motion_rates.model(motion)
    assert model.turning is not None, "checked by the caller"
    turning = model.turning(*symbols)
    error = [
        Powers(ring, {power: one_step.shown(attitude_step, part) for power, part in one.parts.items()}, top)
        for one in one_step.errors(attitude_step, ring, rate.derivatives, top)["error"]
    ]
    one = Powers(ring, {0: ring.one}, top)
    step = [[x + one if i == j else x for j, x in enumerate(row)] for i, row in enumerate(_square(error))]
    true = one_step.true_matrix(ring, rate.derivatives, top)
    back = one_step.true_matrix(ring, [[ring.from_expr(sp.expand(x)) for x in turning]], top)
    raw = _logarithm(_product(step, _product(_square(true), _square(back))))
    axis = model.rate(sp.S.Zero, *symbols) + turning
    skew = algebra.skew(axis)
    matrices = {}
    for power in range(1, top):
        parts = [[element.parts.get(power + 1, ring.zero) for element in row] for row in raw]
        if any(map(any, parts)):
            matrices[power] = sp.Matrix([[rate.expanded(x) for x in row] for row in parts])
    first = sp.Matrix([[x.parts.get(1, ring.zero).as_expr() for x in row] for row in raw])
    if not (first - skew).expand().is_zero_matrix:
        raise InputError(
            f"kernel {attitude_step.kernel.name} does not follow a {motion} motion: it is of order 0"
        )
    return ErrorRate(attitude_step.kernel.name, motion, axis, True, matrices, ring, tuple(map(tuple, raw)))


def _about_an_axis(attitude_step: Step, motion: str, top: int) -> ErrorRate:
    """Return the error rate of a motion about a fixed axis, as a function of time, up to the power top - 1."""
    rate = motion_rates.at_time(motion, top, attitude_step.domain)
    error_parts = one_step.errors(attitude_step, rate.ring, rate.derivatives, top)
    one = Powers(rate.ring, {0: rate.ring.one}, top)
    error = _square(error_parts["error"])
    logs = _logarithm([[x + one if i == j else x for j, x in enumerate(row)] for i, row in enumerate(error)])
    sums: dict[int, list[Any]] = {}
    for power in range(1, top + 1):
        elements = [
            rate.reduced(one_step.shown(attitude_step, x.parts.get(power, rate.ring.zero)))
            for row in logs
            for x in row
        ]
        # Euler and Maclaurin: h sum f = integral of f - h f'/2 + h^2 f''/12 - ...
        for derivative in range(top - power + 1):
            share = rate.ring.domain.from_sympy(_bernoulli(derivative) / sp.factorial(derivative))
            if share and any(elements):
                total = sums.get(power - 1 + derivative, [rate.ring.zero] * 9)
                sums[power - 1 + derivative] = [x + y * share for x, y in zip(total, elements, strict=True)]
            elements = [rate.derivative(x) for x in elements]
    matrices = {}
    for power, elements in sorted(sums.items()):
        if any(elements) and power:
            matrices[power] = sp.Matrix(3, 3, [rate.expanded(x) for x in elements])
    symbols = motion_rates.parameters(motion)
    return ErrorRate(
        attitude_step.kernel.name, motion, motion_rates.model(motion).rate(TIME, *symbols), False, matrices
    )


def _bernoulli(number: int) -> sp.Expr:
    """Return a Bernoulli number; the first one is -1/2, for a sum that begins with its first term."""
    return -sp.Rational(1, 2) if number == 1 else sp.bernoulli(number)


def _require_covariance(attitude_step: Step) -> None:
    """Refuse a user's step whose first powers do not commute with rotations of its inputs."""
    count = 2 + (attitude_step.kernel.order.step if attitude_step.kernel.order else 1)
    frame, ring, rate = one_step.general_rate(attitude_step, count)
    computed = one_step.computed_matrix(attitude_step, ring, rate, count)
    for power in range(1, count + 1):
        invariants(frame, [element.parts.get(power, ring.zero) for element in computed])


def _square(elements: Sequence[Powers]) -> _Matrix:
    return [list(elements[k : k + 3]) for k in (0, 3, 6)]


def _product(left: _Matrix, right: _Matrix) -> _Matrix:
    return [
        [left[i][0] * right[0][j] + left[i][1] * right[1][j] + left[i][2] * right[2][j] for j in range(3)]
        for i in range(3)
    ]


def _logarithm(matrix: _Matrix) -> _Matrix:
    """Return the logarithm of a matrix that begins with the unit matrix."""
    rest = [[x - int(i == j) for j, x in enumerate(row)] for i, row in enumerate(matrix)]
    top = rest[0][0].top
    total, power = rest, rest
    for k in range(2, top + 1):
        power = _product(power, rest)
        if not any(element.parts for row in power for element in row):
            break
        share = rest[0][0].ring.domain.from_sympy(sp.Rational((-1) ** (k + 1), k))
        total = [
            [a + b * share for a, b in zip(first, second, strict=True)]
            for first, second in zip(total, power, strict=True)
        ]
    return total
