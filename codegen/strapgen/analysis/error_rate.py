"""The error rate: what an algorithm adds to the angular rate, as a power series in the step length.

A run of an algorithm is the exact motion of another rate. Where the rate of a motion keeps its length and turns evenly
(constant rate, coning), every step is the same one seen from a turning frame: with M the step's matrix at time 0 and R
the turning, the N-th computed matrix is (M R')^N R^N, and log(M R')/h = W + error rate, W the skew matrix of the axis
about which the frame turns. Where the rate keeps its axis, all matrices commute, and the logarithms of the error
matrices add up: by the formula of Euler and Maclaurin their sum is an integral over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen import algebra
from strapgen.analysis import motion_rates, one_step
from strapgen.analysis.invariants import invariants
from strapgen.analysis.motion_rates import TIME
from strapgen.analysis.one_step import Step
from strapgen.catalogue import Choice
from strapgen.exceptions import InputError
from strapgen.lowering.canonical.decomposition import NotCovariantError
from strapgen.powers import Powers

_Matrix = list[list[Powers]]


@dataclass(frozen=True)
class ErrorRate:
    """What a step adds to the angular rate of a motion.

    Parameters
    ----------
    kernel, motion : str
    axis : Matrix, 3 x 1
        The vector about which the frame turns, in rad/s and reference axes; for a rate that keeps its axis, the rate at
        time t.
    steady : bool
        Whether the error rate is constant in the turning frame: constant rate and coning. Else it is a function of the
        time t, about a fixed axis.
    matrices : dict of int to Matrix, 3 x 3
        Coefficients by power of the step length, in 1/s: for a steady motion in the axes of time 0.
    ring : PolyRing or None
        Ring of the coefficients of a steady motion.
    raw : list of list of Powers
        For a steady motion the sum of turning and error rate in that ring.
    """

    kernel: str
    motion: str
    axis: sp.Matrix
    steady: bool
    matrices: dict[int, sp.Matrix]
    ring: Any = None
    raw: tuple[tuple[Powers, ...], ...] = ()

    @property
    def order(self) -> int | None:
        """The first power that is not zero; None if there is none."""
        return min(self.matrices, default=None)


def error_rate(choice: Choice, motion: str, terms: int = 2) -> ErrorRate:
    """Derive the error rate of a step on a motion.

    Parameters
    ----------
    choice : Choice
        An attitude step that is linear in its state.
    motion : str
        A motion of the catalogue.
    terms : int, optional
        How many powers of the step length from the first one on.

    Returns
    -------
    ErrorRate

    Raises
    ------
    InputError
        If the step is not linear in its state, does not turn with its inputs, or has no series.

    Examples
    --------
    >>> from strapgen import catalogue
    >>> found = error_rate(catalogue.choose("dcm", "rk1", 1), "sinusoidal")
    >>> found.order, found.matrices[1][0, 0]
    (1, a**2*cos(b*t)**2/2)
    """
    taken = one_step.linear_step(choice)
    order = taken.kernel.order
    try:
        if choice.user_kernel is not None:
            _require_covariance(taken)
        top = 1 + (order.step if order else 1) + terms
        most = top + one_step.PATIENCE
        while True:
            found = _rate(taken, motion, top)
            if found.order is not None and found.order + terms <= top:
                break
            if top >= most:
                break
            top += 1
    except ArithmeticError as error:
        raise InputError(f"kernel {taken.kernel.name} has no series in the step length: {error}") from None
    except NotCovariantError:
        raise InputError(
            f"kernel {taken.kernel.name} does not turn with its inputs: what it loses in a run depends on the axes"
        ) from None
    if found.order is None:
        return found
    last = found.order + terms
    kept = {power: matrix for power, matrix in found.matrices.items() if power < last}
    return ErrorRate(found.kernel, motion, found.axis, found.steady, kept, found.ring, found.raw)


def _rate(taken: Step, motion: str, top: int) -> ErrorRate:
    if motion_rates.model(motion).turning is not None:
        return _steady(taken, motion, top)
    return _about_an_axis(taken, motion, top)


def _steady(taken: Step, motion: str, top: int) -> ErrorRate:
    """Return the error rate of a motion whose rate turns evenly, up to the power top - 1."""
    symbols = motion_rates.parameters(motion)
    rate = motion_rates.at_start(motion, top, taken.domain)
    ring = rate.ring
    model = motion_rates.model(motion)
    assert model.turning is not None, "checked by the caller"
    turning = model.turning(*symbols)
    error = [
        Powers(ring, {power: one_step.shown(taken, part) for power, part in one.parts.items()}, top)
        for one in one_step.errors(taken, ring, rate.derivatives, top)["error"]
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
        matrix = sp.Matrix([[rate.expression(x) for x in row] for row in parts])
        if any(matrix):
            matrices[power] = matrix
    first = sp.Matrix([[x.parts.get(1, ring.zero).as_expr() for x in row] for row in raw])
    if not (first - skew).expand().is_zero_matrix:
        raise InputError(f"kernel {taken.kernel.name} does not follow a {motion} motion: it is of order 0")
    return ErrorRate(taken.kernel.name, motion, axis, True, matrices, ring, tuple(map(tuple, raw)))


def _about_an_axis(taken: Step, motion: str, top: int) -> ErrorRate:
    """Return the error rate of a motion about a fixed axis, as a function of time, up to the power top - 1."""
    rate = motion_rates.at_time(motion, top, taken.domain)
    made = one_step.errors(taken, rate.ring, rate.derivatives, top)
    one = Powers(rate.ring, {0: rate.ring.one}, top)
    error = _square(made["error"])
    logs = _logarithm([[x + one if i == j else x for j, x in enumerate(row)] for i, row in enumerate(error)])
    found: dict[int, sp.Matrix] = {}
    for power in range(1, top + 1):
        parts = [[row_element.parts.get(power, rate.ring.zero) for row_element in row] for row in logs]
        matrix = sp.Matrix([[rate.expression(one_step.shown(taken, x)) for x in row] for row in parts])
        # Euler and Maclaurin: h sum f = integral of f - h f'/2 + h^2 f''/12 - ...
        for derivative in range(top - power + 1):
            share = _bernoulli(derivative) / sp.factorial(derivative)
            if share and any(matrix):
                total = found.get(power - 1 + derivative, sp.zeros(3))
                found[power - 1 + derivative] = total + share * matrix
            matrix = matrix.diff(TIME)
    matrices = {}
    for power, matrix in sorted(found.items()):
        reduced = matrix.applyfunc(sp.expand)
        if any(reduced) and power:
            matrices[power] = reduced
    symbols = motion_rates.parameters(motion)
    return ErrorRate(
        taken.kernel.name, motion, motion_rates.model(motion).rate(TIME, *symbols), False, matrices
    )


def _bernoulli(number: int) -> sp.Expr:
    """Return a Bernoulli number; the first one is -1/2, for a sum that begins with its first term."""
    return -sp.Rational(1, 2) if number == 1 else sp.bernoulli(number)


def _require_covariance(taken: Step) -> None:
    """Refuse a user's step that does not turn with its inputs, as far as its first powers show."""
    count = 2 + (taken.kernel.order.step if taken.kernel.order else 1)
    frame, ring, rate = one_step.general_rate(taken, count)
    made = one_step.computed_matrix(taken, ring, rate, count)
    for power in range(1, count + 1):
        invariants(frame, [element.parts.get(power, ring.zero) for element in made])


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
