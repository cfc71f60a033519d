"""Mean rates of an algorithm whose angle increments come from a gyro of limited bandwidth."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import sympy as sp

from strapgen.analysis.vibration.mean_rates import Assessment
from strapgen.analysis.vibration.response import Form, Pair
from strapgen.analysis.vibration.systems import ANGLES, F
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact


def through_gyro(
    assessment: Assessment, bandwidth_hz: float | str | Fraction, damping: float | str | Fraction
) -> Assessment:
    """Return the assessment of an algorithm that sees angles through a gyro of second order.

    The gyro's transfer function is G = 1/(1 + 2 zeta s/w + s^2/w^2). A product of two angles has the factor
    ``|G|^2``, one of an angle and a velocity the factor G; the true rate stays what it is.

    Parameters
    ----------
    assessment : Assessment
        Of a step, of the vector of one, or of an algorithm in two speeds.
    bandwidth_hz : number
        Natural frequency w/(2 pi) in Hz.
    damping : number
        zeta.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        If a number is not above 0, or the kernel is a fast loop alone, whose rates leave out a term of the slow loop.

    Examples
    --------
    >>> from strapgen import choose
    >>> from strapgen.analysis.vibration import of
    >>> seen = through_gyro(of(choose("euler", "coning-compressed", 4)), 40, "0.7071")
    >>> [float(f"{rate:.4g}") for rate in seen.rates(10, 0.04, theta_x=0.01, theta_y=0.01, phase=1)]
    [-0.002644, -0.002633, 1.037e-05]
    """
    gyro = (bandwidth_hz, damping)
    return through_gyros(assessment, gyro, gyro)


def through_gyros(
    assessment: Assessment,
    x: tuple[float | str | Fraction, float | str | Fraction],
    y: tuple[float | str | Fraction, float | str | Fraction],
) -> Assessment:
    """Return the assessment of an algorithm that sees the angles about x and y through gyros of their own.

    Gyros of unequal phase show a coning that is not there: pseudo-coning.

    Parameters
    ----------
    assessment : Assessment
        As for `through_gyro`.
    x, y : tuple of number
        Natural frequency in Hz and damping of the gyro of each axis.

    Returns
    -------
    Assessment

    Raises
    ------
    InputError
        As `through_gyro` does.

    Examples
    --------
    Angles in phase are no coning, and equal gyros leave them in phase:

    >>> from strapgen import choose
    >>> from strapgen.analysis.vibration import of
    >>> plain, wave = of(choose("euler", "coning-compressed", 4)), {"theta_x": 0.01, "theta_y": 0.01}
    >>> through_gyros(plain, (80, "0.7"), (80, "0.7")).rates(20, 0.004, **wave).computed
    0.0
    >>> round(through_gyros(plain, (80, "0.7"), (60, "0.7")).rates(20, 0.004, **wave).computed, 8)
    0.00078679
    """
    if assessment.recursion and assessment.kernel != "two-speed":
        raise InputError(
            f"{assessment.kernel} is a fast loop; its rates through a gyro are those of two-speed, both loops together"
        )
    responses = dict(zip(ANGLES, (_response(*gyro) for gyro in (x, y)), strict=True))

    def seen(pair: Pair, form: Form) -> Form:
        # The factor is G of the first channel times the conjugate of that of the second; velocities stay as they are.
        first, second = (responses.get(channel) for channel in pair)
        if first is None:  # of an angle and a velocity, the angle is the first
            return form
        real, imaginary = (
            (first.real, first.imaginary) if second is None else _conjugate_product(first, second)
        )
        return Form(
            _times(form.real, real) - _times(form.imaginary, imaginary),
            _times(form.real, imaginary) + _times(form.imaginary, real),
        )

    return replace(
        assessment, computed={pair: seen(pair, form) for pair, form in assessment.computed.items()}
    )


class _Response(NamedTuple):
    """The transfer function of a gyro, by real and imaginary part, and the square of its magnitude."""

    real: sp.Expr
    imaginary: sp.Expr
    power: sp.Expr


def _response(bandwidth_hz: float | str | Fraction, damping: float | str | Fraction) -> _Response:
    natural, ratio = (
        exact(checks.number(what, value, positive=True))
        for what, value in (("gyro-bandwidth-hz", bandwidth_hz), ("gyro-damping", damping))
    )
    in_phase, across = 1 - (F / natural) ** 2, 2 * ratio * F / natural
    power = 1 / (in_phase**2 + across**2)
    return _Response(in_phase * power, -across * power, power)


def _conjugate_product(one: _Response, other: _Response) -> tuple[sp.Expr, sp.Expr]:
    """Return one response times the conjugate of another."""
    if one == other:
        return one.power, sp.S.Zero
    return (
        one.real * other.real + one.imaginary * other.imaginary,
        one.imaginary * other.real - one.real * other.imaginary,
    )


def _times(total: sp.Expr, factor: sp.Expr) -> sp.Expr:
    return sp.Add(*(factor * term for term in sp.Add.make_args(total)))
