"""Mean rates of an algorithm whose angle increments come from a gyro of limited bandwidth."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.support import checks
from strapgen.support.exceptions import InputError
from strapgen.symbolic.evaluation import exact
from strapgen.vibration.mean_rates import Assessment
from strapgen.vibration.response import Form, Pair
from strapgen.vibration.systems import ANGLES, F


def through_gyro(
    assessment: Assessment, bandwidth_hz: float | str | Fraction, damping: float | str | Fraction
) -> Assessment:
    """Return the assessment of an algorithm that sees angles through a gyro of second order.

    The gyro's transfer function is G = 1/(1 + 2 zeta s/w + s^2/w^2). A product of two angles has the factor |G|^2, one
    of an angle and a velocity the factor G; the true rate stays what it is.

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
    >>> from strapgen.vibration import of
    >>> seen = through_gyro(of(choose("euler", "coning-compressed", 4)), 40, "0.7071")
    >>> [float(f"{rate:.4g}") for rate in seen.rates(10, 0.04, theta_x=0.01, theta_y=0.01, phase=1)]
    [-0.002644, -0.002633, 1.037e-05]
    """
    if assessment.recursion and assessment.kernel != "two-speed":
        raise InputError(
            f"{assessment.kernel} is a fast loop; its rates through a gyro are those of two-speed, both loops together"
        )
    natural, ratio = (
        exact(checks.number(what, value, positive=True))
        for what, value in (("gyro-bandwidth-hz", bandwidth_hz), ("gyro-damping", damping))
    )
    in_phase, across = 1 - (F / natural) ** 2, 2 * ratio * F / natural
    power = 1 / (in_phase**2 + across**2)

    def seen(pair: Pair, form: Form) -> Form:
        angles = sum(channel in ANGLES for channel in pair)
        if angles == 2:
            return Form(_times(form.real, power), _times(form.imaginary, power))
        if not angles:
            return form
        # The angle is the first of the two. G is (in_phase - j across) power.
        return Form(
            _times(form.real, in_phase * power) + _times(form.imaginary, across * power),
            _times(form.imaginary, in_phase * power) - _times(form.real, across * power),
        )

    return replace(
        assessment, computed={pair: seen(pair, form) for pair, form in assessment.computed.items()}
    )


def _times(total: sp.Expr, factor: sp.Expr) -> sp.Expr:
    return sp.Add(*(factor * term for term in sp.Add.make_args(total)))
