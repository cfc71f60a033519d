"""The error rate: the rate that an algorithm in effect adds to the angular rate, as a series in the step.

A run of an algorithm is the exact motion of a slightly different rate. If the rate of a motion has a constant length
and rotates uniformly (constant rate, coning), all steps are equal in a frame that rotates with it. With the matrix M of
the step at time 0 and the rotation R of the frame in a step, the N-th computed matrix is (M R')^N R^N, and
log(M R')/h = W + error rate, where W is the skew matrix of the rate of the frame. If the axis of the rate is fixed, all
matrices commute and the logarithms of the error matrices add up; the formula of Euler and Maclaurin turns their sum
into an integral over time.

The drift of a run has a part that grows with time and one that stays bounded; both follow from the error rate. To first
order in the error, the error matrix of a run is its integral, carried along with the motion. If the frame turns at a
constant rate about an axis s, the component of the drift rate along s accumulates, and those across it oscillate with
the angle |s| t. Orthonormalization does not change the drift to that order, and keeps scale and skew from growing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import sympy as sp

from strapgen import catalogue
from strapgen.analysis.series import motion_rates
from strapgen.analysis.series.invariants import invariants, sum_text, vector_texts
from strapgen.analysis.series.motion_rates import TIME, in_powers_of_the_step, is_plain, parameters
from strapgen.analysis.series.series import MOST_TERMS, STEP
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel import algebra
from strapgen.kernel.covariants import NotCovariantError
from strapgen.kernel.power_series import Powers
from strapgen.lab import one_step
from strapgen.lab.one_step import Step
from strapgen.results.records import INTERNAL, Record, entry

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
    with in_powers_of_the_step(attitude_step.kernel.name):
        if choice.user_kernel is not None:
            _require_covariance(attitude_step)
        top = 1 + (order.step if order else 1) + terms
        most = top + one_step.PATIENCE
        while True:
            rates = _rate(attitude_step, motion, top)
            if top >= most or (rates.order is not None and rates.order + terms <= top):
                break
            top += 1
    if rates.order is None:
        return rates
    last = rates.order + terms
    leading = {power: matrix for power, matrix in rates.matrices.items() if power < last}
    return ErrorRate(rates.kernel, motion, rates.axis, rates.steady, leading, rates.ring, rates.raw)


def _rate(attitude_step: Step, motion: str, top: int) -> ErrorRate:
    if motion_rates.model(motion).turning is not None:
        return _steady_error_rate(attitude_step, motion, top)
    return _error_rate_about_an_axis(attitude_step, motion, top)


def _steady_error_rate(attitude_step: Step, motion: str, top: int) -> ErrorRate:
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


def _error_rate_about_an_axis(attitude_step: Step, motion: str, top: int) -> ErrorRate:
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
    try:
        for power in range(1, count + 1):
            invariants(frame, [element.parts.get(power, ring.zero) for element in computed])
    except NotCovariantError:
        raise InputError(
            f"kernel {attitude_step.kernel.name} does not turn with its inputs: "
            "what it loses in a run depends on the axes"
        ) from None


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


def _sums(terms: Mapping[int, sp.Matrix]) -> list[str]:
    return vector_texts(terms, STEP)


# The drift of a run has a part that grows with time and a part that stays bounded; both follow from the error rate.
#
# To first order in the error, the error matrix of a run is the integral of the error rate, carried along with the
# motion. If the frame turns at a constant rate about an axis s, the component of the drift rate along s accumulates,
# and the components across it oscillate with the angle |s| t. To the same order, orthonormalization does not change
# the drift, and it prevents scale and skew from accumulating.


@dataclass(frozen=True)
class RunDrift(Record):
    """The drift of a run that begins at time 0."""

    kernel: str = field(metadata=INTERNAL)
    motion: str = field(metadata=INTERNAL)
    #: Drift rate in rad/s, reference axes: coefficients by power of the step length
    secular: dict[int, sp.Matrix] = field(
        metadata=entry(key="drift_rate", unit="rad/s", write=_sums, kind=list[str])
    )
    #: Oscillating part of the drift in rad as a function of the time t, zero at time 0; to first order in the
    #: error
    bounded: dict[int, sp.Matrix] = field(
        metadata=entry(key="drift_bounded", unit="rad", write=_sums, kind=list[str])
    )
    #: Rate in 1/s at which the logarithm of the scale across the drift grows, by power of the step length
    growth: dict[int, sp.Expr] = field(
        metadata=entry(key="growth_rate", unit="1/s", write=lambda terms: sum_text(terms, STEP), kind=str)
    )

    def drift(self, time: sp.Expr = TIME) -> list[sp.Expr]:
        """Return the drift in rad on x, y, z after a time in s, as the sum of the known terms."""
        total = sp.zeros(3, 1)
        for power, row in self.secular.items():
            total += time * row * STEP**power
        for power, row in self.bounded.items():
            total += row.subs(TIME, time) * STEP**power
        return list(total)


def accumulate(choice: Choice, motion: str, terms: int = 2) -> RunDrift:
    """Derive the drift of a run on a motion of the catalogue.

    >>> from strapgen import catalogue
    >>> run = accumulate(catalogue.choose("dcm", "rk2"), "coning", terms=1)
    >>> sp.factor(run.secular[2][1])
    -(b + g)*(a**4 + a**2*b**2 + a**2*b*g + 2*a**2*g**2 + b*g**3 + g**4)/(6*(a**2 + b**2 + 2*b*g + g**2))
    """
    checks.choice("motion", motion, catalogue.MOTIONS)
    terms = checks.count("terms", terms, largest=MOST_TERMS)
    error = error_rate(choice, motion, 2 * terms)
    run = _steady_drift(error) if error.steady else _drift_about_an_axis(error)
    return replace(
        run,
        secular=_first(run.secular, terms),
        bounded=_first(run.bounded, terms),
        growth=_first(run.growth, terms),
    )


def _first(rows: dict[int, Any], terms: int) -> dict[int, Any]:
    return dict(list(rows.items())[:terms])


def _steady_drift(error: ErrorRate) -> RunDrift:
    """Return the drift of a motion whose frame turns at a constant rate.

    The sum of the frame's rate and the error rate has the eigenvalues of the run. Their imaginary part, minus the
    frame's rate, is the secular drift to all orders in the error.
    """
    powers = list(error.matrices)
    if not powers:
        return RunDrift(error.kernel, error.motion, {}, {}, {})
    shifts = _eigenvalue(error, max(powers))
    secular, growth = {}, {}
    for power, (real, imaginary) in shifts.items():
        row = (-imaginary * error.axis).applyfunc(_short)
        if any(row):
            secular[power] = row
        if real := _short(real):
            growth[power] = real
    bounded = {}
    # From twice the first power on, products of two errors are missing, so the bounded drift ends before that power.
    known = [power for power in powers if power < 2 * powers[0]]
    for power in known if error.motion != "constant" else ():
        row = _swing(_drift(error.matrices[power]), error.axis)
        if any(row):
            bounded[power] = row
    return RunDrift(error.kernel, error.motion, secular, bounded, growth)


def _drift(matrix: sp.Matrix) -> sp.Matrix:
    return sp.Matrix(one_step.split(list(matrix))["drift"])


def _swing(drift: sp.Matrix, axis: sp.Matrix) -> sp.Matrix:
    """Return the integral of a drift rate that turns with a frame, without its component along the axis."""
    square = algebra.dot(axis, axis)
    across = drift - algebra.dot(drift, axis) / square * axis
    turned = algebra.cross(axis, drift)
    length = sp.sqrt(sp.expand(square))
    return across.applyfunc(_short) * sp.sin(length * TIME) / length + turned.applyfunc(_short) * (
        1 - sp.cos(length * TIME)
    ) / sp.expand(square)


def _short(expression: sp.Expr) -> sp.Expr:
    """Return an expression in lowest terms and factored if its numbers are short fractions, otherwise unchanged."""
    return sp.factor(sp.cancel(expression)) if is_plain(expression) else expression


def _eigenvalue(error: ErrorRate, top: int) -> dict[int, tuple[sp.Expr, sp.Expr]]:
    """Return the eigenvalue of the run near i |s| as pairs (u, v) by power of the step, for u + i |s| v.

    With y = i |s| and S = s . s the characteristic polynomial at power 0 is y^3 + S y, and its derivative is -2 S.
    Each further coefficient therefore follows from those before it by one division.
    """
    ring = error.ring
    first = min(error.matrices)
    names = [str(symbol) for symbol in ring.symbols]
    extended, y, half, *_ = sp.ring(["y", "half_over_S", *names], ring.domain)

    def lift(element: Powers) -> Powers:
        # Division of log(M R') by h lowers each power by one. Below the first power of the error rate only rounding
        # is left.
        parts = {
            power - 1: part.set_ring(extended)
            for power, part in element.parts.items()
            if power == 1 or power > first
        }
        return Powers(extended, parts, top)

    m = [[lift(element) for element in row] for row in error.raw]
    trace = m[0][0] + m[1][1] + m[2][2]
    minors = sum(
        (m[i][i] * m[j][j] - m[i][j] * m[j][i] for i, j in ((0, 1), (0, 2), (1, 2))),
        Powers(extended, {}, top),
    )
    determinant = algebra.dot(m[0], algebra.cross_elements(m[1], m[2]))
    axis = [extended.from_expr(sp.expand(x)) for x in error.axis]
    square = algebra.dot(axis, axis)
    value = Powers(extended, {0: y}, top)
    shifts: dict[int, tuple[sp.Expr, sp.Expr]] = {}
    for power in range(first, top + 1):
        cubic = ((value - trace) * value + minors) * value - determinant
        shift = cubic.parts.get(power, extended.zero).rem([y**2 + square]) * half
        value = value + Powers(extended, {power: shift}, top)
        imaginary = shift.diff(y)
        shifts[power] = (_quotient(shift - imaginary * y, square), _quotient(imaginary, square))
    return {power: pair for power, pair in shifts.items() if any(pair)}


def _quotient(element: Any, square: Any) -> sp.Expr:
    """Return a polynomial in the second generator, half_over_S, as an expression with 1/(2 S) for it.

    With short fractions it is one fraction in lowest terms: S is a sum of squares, which no other factor divides.
    """
    ring = element.ring
    half = ring.gens[1]
    if ring.domain != sp.QQ or not all(
        is_plain(number) for number in map(ring.domain.to_sympy, element.coeffs())
    ):
        return element.as_expr().subs(half.as_expr(), 1 / (2 * square.as_expr()))
    depth = element.degree(half)
    above = ring.zero
    for exponents, number in element.terms():
        rest = ring.from_dict({(exponents[0], 0, *exponents[2:]): number})
        above += rest * (2 * square) ** (depth - exponents[1])
    while depth > 0:
        lower, remainder = above.div(2 * square)
        if remainder:
            break
        above, depth = lower, depth - 1
    return above.as_expr() / (2 * square.as_expr()) ** max(depth, 0)


def _drift_about_an_axis(error: ErrorRate) -> RunDrift:
    """Return the drift of a motion about a fixed axis, which is the integral of the error rate."""
    secular, bounded, growth = {}, {}, {}
    for power, matrix in error.matrices.items():
        mean, swing = _integrate(_drift(matrix), error)
        if any(mean):
            secular[power] = mean
        if any(swing):
            bounded[power] = swing
        across = (matrix[0, 0] + matrix[2, 2]) / 2
        (gained,), _ = _integrate(sp.Matrix([across]), error)
        if gained:
            growth[power] = gained
    return RunDrift(error.kernel, error.motion, secular, bounded, growth)


def _integrate(rates: sp.Matrix, error: ErrorRate) -> tuple[sp.Matrix, sp.Matrix]:
    """Return the mean of rates, for a polynomial zero, and the integral from time 0 of the rest."""
    if error.motion == "polynomial":
        return sp.zeros(*rates.shape), rates.applyfunc(lambda x: sp.Poly(x, TIME).integrate().as_expr())
    b = sp.Symbol("b")
    means, swings = [], []
    for rate in rates:
        mean, swing = _fourier(rate, b)
        means.append(_short(mean))
        swings.append(swing)
    return sp.Matrix(means), sp.Matrix(swings)


def antiderivative(matrix: sp.Matrix, error: ErrorRate) -> sp.Matrix:
    """Return the integral from time 0 to t of a term of the error rate of a motion about a fixed axis.

    `matrix`: the term in 1/s, a function of the time t.
    """
    if error.motion == "polynomial":
        variables = (TIME, *parameters(error.motion))
        return matrix.applyfunc(lambda x: sp.Poly(x, *variables).integrate(TIME).as_expr())
    mean, swing = _integrate(matrix, error)
    return mean.reshape(*matrix.shape) * TIME + swing.reshape(*matrix.shape)


@lru_cache(256)
def _fourier(expression: sp.Expr, b: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """Return the mean of a polynomial in cos(b t) and sin(b t), and the integral from 0 to t of its waves."""
    z = sp.Symbol("z")
    cosine, sine = (z + 1 / z) / 2, (z - 1 / z) / (2 * sp.I)
    written = sp.expand(sp.expand(expression).subs({sp.cos(b * TIME): cosine, sp.sin(b * TIME): sine}))
    mean, swing = sp.S.Zero, sp.S.Zero
    terms = sp.collect(written, z, evaluate=False)
    for term, coefficient in terms.items():
        harmonic = int(sp.degree(term, z)) if term.is_polynomial(z) else -int(sp.degree(1 / term, z))
        if harmonic == 0:
            mean += coefficient
        elif harmonic > 0:
            other = terms.get(z**-harmonic, sp.S.Zero)
            even, odd = sp.expand(coefficient + other), sp.expand(sp.I * (coefficient - other))
            angle = harmonic * b * TIME
            swing += _short(even / (harmonic * b)) * sp.sin(angle)
            swing += _short(odd / (harmonic * b)) * (1 - sp.cos(angle))
    return sp.expand(mean), swing
