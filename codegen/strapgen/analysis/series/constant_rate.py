"""Closed forms of the errors that an algorithm makes at a constant rate, in one step and in any number of steps.

A step by the angle x rotates the plane across the axis by atan2(s, c) and stretches it by (s^2 + c^2)^(1/2), where s
and c are the approximations of sin x and cos x by the method. All steps are equal and commute, so N steps lose N times
the angle and stretch by the N-th power.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import mpmath
import sympy as sp

from strapgen import catalogue
from strapgen.analysis.series.motion_rates import CONSTANT
from strapgen.analysis.series.series import PARTS, STEP
from strapgen.catalogue import Choice
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, evaluate_stages
from strapgen.kernel.power_series import Powers, constant, field, function
from strapgen.lab import one_step

if TYPE_CHECKING:
    from strapgen.analysis.series.prediction import Matrix, Prediction, Transfer
    from strapgen.lab.motions.motions import Motion

#: The angle of a step, |w| h.
ANGLE = sp.Symbol("x", positive=True)
#: The number of steps.
STEPS = sp.Symbol("N", positive=True, integer=True)


@dataclass(frozen=True)
class ConstantRate:
    """The effect of one step at a constant rate, as functions of the angle x of the step."""

    kernel: str
    #: Approximations of cos x and sin x by the method; for Euler and Cayley-Klein parameters, of cos(x/2) and
    #: sin(x/2)
    cosine: sp.Expr
    sine: sp.Expr
    #: Square of the factor by which the state grows across the axis
    stretch_squared: sp.Expr
    #: Whether the state consists of Euler or Cayley-Klein parameters, so that the matrix is quadratic in it
    parameters: bool
    #: Factor along the axis, 1 for a rotation
    along: sp.Expr
    #: The lowest power of an error that does not come from the rounding of published coefficients
    lowest: int = 0

    @property
    def angle_lost(self) -> sp.Expr:
        """Angle in rad by which the computed attitude lags behind the true one in a step."""
        angle = ANGLE / 2 if self.parameters else ANGLE
        if (self.cosine, self.sine) == (sp.cos(angle), sp.sin(angle)):
            return sp.S.Zero
        turned = sp.atan2(self.sine, self.cosine)
        return ANGLE - (2 * turned if self.parameters else turned)

    @property
    def stretch(self) -> sp.Expr:
        """Factor by which the matrix grows across the axis, which is 1 plus the scale error of one step."""
        return self.stretch_squared if self.parameters else sp.sqrt(self.stretch_squared)

    def series(self, terms: int = 2) -> dict[int, sp.Rational]:
        """Return the first terms of the angle lost in powers of x.

        Returns: coefficients by power of x, in rad.

        >>> constant_rate(catalogue.choose("dcm", "rk1")).series(3)
        {3: 1/3, 5: -1/5, 7: 1/7}
        """
        ring, _ = sp.ring("x", field((self.cosine, self.sine)))
        top = 4
        while True:
            top += 4
            angle = {"x": Powers(ring, {1: ring.one}, top)}

            def number(value: sp.Rational, top: int = top) -> Powers:
                return constant(ring, value, top)

            cosine, sine = (
                algebra.evaluate(part, angle, number, function)
                for part in (_plain(self.cosine), _plain(self.sine))
            )
            # d atan2(s, c) = (c ds - s dc) / (c^2 + s^2)
            slope = (cosine * _slope(sine) - sine * _slope(cosine)) / (cosine * cosine + sine * sine)
            factor = 2 if self.parameters else 1
            lost = {
                power + 1: sp.Rational(int(power == 0))
                - factor * ring.domain.to_sympy(slope.parts.get(power, ring.zero).LC) / (power + 1)
                for power in range(top - 1)
            }
            leading = {power: value for power, value in lost.items() if value and power >= self.lowest}
            if self.lowest:  # with rounded coefficients the results have no more than 12 digits
                leading = {power: sp.Rational(f"{float(value):.11e}") for power, value in leading.items()}
            if len(leading) >= terms or top >= _TOP:
                return dict(list(leading.items())[:terms])

    def errors(self) -> dict[str, list[sp.Expr]]:
        """Return the nine errors after N steps without orthonormalization: "drift", "scale" and "skew", three each.

        The expressions use the symbols w_x, w_y, w_z in rad/s, h in s and N.
        """
        return self._errors(self.stretch, self.along)

    def errors_orthonormalized(self) -> dict[str, list[sp.Expr]]:
        """Return the nine errors after N steps if the matrix is orthonormalized exactly, any number of times."""
        return self._errors(sp.S.One, sp.S.One)

    def _errors(self, stretch: sp.Expr, along: sp.Expr) -> dict[str, list[sp.Expr]]:
        rate = sp.Matrix(CONSTANT)
        length = sp.sqrt(algebra.dot(rate, rate))
        here = {ANGLE: length * STEP}
        gained = _product(
            stretch.subs(here), along.subs(here), self.angle_lost.subs(here), STEPS, *(rate / length)
        )
        split = one_step.split(list(gained - sp.eye(3)))
        return {part: split[part] for part in PARTS}


#: The last power of the series of the angle lost.
_TOP = 40


def _product(stretch: sp.Expr, along: sp.Expr, lost: sp.Expr, steps: sp.Expr, *axis: sp.Expr) -> sp.Matrix:
    """Return the computed matrix times the transposed true one, after a number of steps about a unit vector."""
    u = sp.Matrix(axis)
    projection = u * u.T
    turned = sp.cos(steps * lost) * (sp.eye(3) - projection) - sp.sin(steps * lost) * algebra.skew(u)
    return along**steps * projection + stretch**steps * turned


def _slope(series: Powers) -> Powers:
    """Return the derivative of a series with respect to its small quantity."""
    return Powers(
        series.ring,
        {power - 1: part * power for power, part in series.parts.items() if power},
        series.top - 1,
    )


def constant_rate(choice: Choice) -> ConstantRate:
    """Derive the effect of one step at a constant rate.

    >>> constant_rate(catalogue.choose("dcm", "rk1")).angle_lost
    x - atan(x)
    >>> constant_rate(catalogue.choose("euler", "rk2")).stretch_squared
    x**4/64 + 1
    """
    attitude_step = one_step.linear_step(choice)
    kernel, step_kernels = attitude_step.kernel, attitude_step.kernel.attitude_step
    assert step_kernels is not None, "checked by `linear_step`"
    state, samples = kernel.inputs
    share = 1 if attitude_step.nodes is not None else samples.shape[0] - step_kernels.extra_increments
    identity = {
        name: sp.Rational(x.numerator, x.denominator)
        for name, x in zip(state.elements, step_kernels.identity, strict=True)
    }
    turned = {name: ANGLE / share if k % 3 == 2 else sp.S.Zero for k, name in enumerate(samples.elements)}
    attitude = None
    if step_kernels.attitude is not None:
        attitude = catalogue.companion(kernel, step_kernels.attitude)
    try:
        result = _rational(attitude_step.domain, kernel, {**identity, **turned}, attitude)
    except _NotRationalError:
        result = _simplify(kernel, {**identity, **turned}, attitude)
    scalar = next((k for k, x in enumerate(step_kernels.identity) if x), 0)
    return ConstantRate(kernel.name, *result.part(scalar), attitude_step.lowest)


@dataclass(frozen=True)
class _StepResult:
    """A state and its direction cosine matrix after a step by the angle x about z, in lowest terms."""

    state: list[sp.Expr]
    matrix: list[sp.Expr]
    #: The sum of the squares of the state's elements, and that of the first column of the matrix
    squares: tuple[sp.Expr, sp.Expr]

    def part(self, scalar: int) -> tuple[sp.Expr, sp.Expr, sp.Expr, bool, sp.Expr]:
        """Return cosine, sine, squared stretch, whether these belong to half the angle, and the factor along z."""
        used = [k for k, x in enumerate(self.state) if x]
        if len(self.state) == 4 and len(used) == 2:
            vector = next(k for k in used if k != scalar)
            return self.state[scalar], self.state[vector], self.squares[0], True, self.squares[0]
        return self.matrix[0], self.matrix[3], self.squares[1], False, self.matrix[8]


class _NotRationalError(Exception):
    """The step is no rational function of the angle."""


def _rational(
    domain: Any, kernel: Kernel, values: dict[str, sp.Expr], attitude: Kernel | None
) -> _StepResult:
    """Return the result of a step that is a rational function of the angle."""
    rational, _ = sp.field([ANGLE], domain)

    def number(value: sp.Expr) -> Any:
        return rational(domain.from_sympy(value))

    def function(expression: sp.Expr, arguments: list[Any]) -> Any:
        if expression.is_number:
            return number(expression)
        if expression.is_Pow and expression.exp.is_Integer:
            return arguments[0] ** int(expression.exp)
        raise _NotRationalError

    def evaluated(each: Kernel, inputs: dict[str, Any]) -> list[Any]:
        known = evaluate_stages((*each.stages, *each.outputs), inputs, number, function)
        return [known[name] for name in each.outputs[-1].signal.elements]

    state = evaluated(kernel, {name: rational.from_expr(value) for name, value in values.items()})
    matrix = state
    if attitude is not None:
        matrix = evaluated(attitude, dict(zip(attitude.inputs[0].elements, state, strict=True)))
    squares = (sum((x * x for x in state), rational.zero), matrix[0] ** 2 + matrix[3] ** 2)
    return _StepResult(
        [x.as_expr() for x in state],
        [x.as_expr() for x in matrix],
        (sp.expand(squares[0].as_expr()), sp.expand(squares[1].as_expr())),
    )


def _simplify(kernel: Kernel, values: dict[str, Any], attitude: Kernel | None) -> _StepResult:
    """Return the result of a step that uses functions of the angle, simplified by SymPy."""

    def evaluated(each: Kernel, inputs: dict[str, Any]) -> list[sp.Expr]:
        rows = each.expand(inputs)[each.outputs[-1].signal.name]
        return [sp.simplify(sp.sympify(x).rewrite(sp.sin)) for x in rows]

    state = evaluated(kernel, values)
    matrix = state
    if attitude is not None:
        matrix = evaluated(attitude, dict(zip(attitude.inputs[0].elements, state, strict=True)))
    squares = sum(x**2 for x in state), matrix[0] ** 2 + matrix[3] ** 2
    return _StepResult(state, matrix, (sp.simplify(squares[0]), sp.simplify(squares[1])))


def _plain(expression: sp.Expr) -> sp.Expr:
    """Return an expression in the symbol x without assumptions, for evaluation by name."""
    return expression.subs(ANGLE, sp.Symbol("x"))


def errors_after(
    choice: Choice,
    motion: Motion,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
) -> Prediction:
    """Return the exact errors of a run at a constant rate, from powers of one step.

    >>> from strapgen.lab.motions.motions import motion
    >>> found = errors_after(catalogue.choose("dcm", "rk1"), motion("constant", y_deg_s=10), "1/8", 180)
    >>> round(float(found.scale[-1][0]), 4), round(float(found.drift[-1][1]), 6)
    (0.4086, 0.007019)
    """
    from strapgen.analysis.series.prediction import follow  # runs need numpy; closed forms do not
    from strapgen.run import exact

    closed_form = constant_rate(choice)
    names = sp.symbols("stretch along lost steps axis_x axis_y axis_z")
    product = sp.lambdify(names, _product(*names), "mpmath")
    parts = [
        sp.lambdify(ANGLE, part, "mpmath")
        for part in (closed_form.stretch, closed_form.along, closed_form.angle_lost)
    ]
    rate = [mpmath.mpf(value) for value in motion.parameters.values()]

    def transfer(h: Fraction) -> Transfer:
        length = mpmath.norm(rate)
        axis = [x / length for x in rate] if length else rate
        gained = [part(length * exact.number(h)) for part in parts]

        def grow(begin: Fraction, end: Fraction) -> Matrix:
            return product(*gained, int((end - begin) / h), *axis)

        return grow

    return follow(choice, motion, transfer, step, duration, orthonormalize, record)
