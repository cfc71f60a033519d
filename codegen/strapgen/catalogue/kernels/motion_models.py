"""Motions with a closed-form attitude: body rate, exact angle increments, true direction cosine matrix.

Formulas whose textbook form is 0/0 somewhere are written with sin(x)/x, which has a value there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp

from strapgen.catalogue.kernels.kernel_names import MOTIONS as MOTION_PARAMETERS
from strapgen.catalogue.kinematics import DCM_MEANING, THESIS
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, KernelBuilder

Formula = Callable[..., sp.Matrix]


@dataclass(frozen=True)
class MotionModel:
    """A motion in closed form."""

    name: str
    title: str
    rate: Formula  # rate(t, *parameters) in rad/s, body axes
    increment: Formula  # increment(m, d, *parameters), integral of the rate over [m - d/2, m + d/2] in rad
    #: attitude(t, *parameters), direction cosine matrix, body to reference; the identity at t = 0
    attitude: Formula
    #: turning(*parameters), the constant vector n in rad/s about which a rate of constant length rotates uniformly: the
    #: body rate is that of time 0 rotated by -n t, and the attitude is the rotation by (rate at time 0 + n) t times the
    #: rotation by -n t. None for other motions.
    turning: Formula | None = None


def _about_y(angle: sp.Expr) -> sp.Matrix:
    """Return the rotation about y; its cosine and sine of one angle are cheaper than the general form."""
    c, s = sp.cos(angle), sp.sin(angle)
    return sp.Matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _polynomial_angle(t: sp.Expr, *a: sp.Expr) -> sp.Expr:
    return sp.Add(*(coefficient * t ** (k + 1) / (k + 1) for k, coefficient in enumerate(a)))


def _polynomial_increment(m: sp.Expr, d: sp.Expr, *a: sp.Expr) -> sp.Expr:
    # The expansion about the middle of the interval leaves no difference of large numbers.
    return sp.expand(_polynomial_angle(m + d / 2, *a) - _polynomial_angle(m - d / 2, *a))


def _chord(m: sp.Expr, d: sp.Expr, b: sp.Expr, wave: Callable[[sp.Expr], sp.Expr]) -> sp.Expr:
    """Return the integral over [m - d/2, m + d/2] of wave(b t), a sine or a cosine."""
    return d * sp.sinc(b * d / 2) * wave(b * m)


def _coning_attitude(t: sp.Expr, a: sp.Expr, b: sp.Expr, g: sp.Expr) -> sp.Matrix:
    return algebra.rotation(t * sp.Matrix([0, b + g, a])) * _about_y(-b * t)


MOTIONS = {
    motion.name: motion
    for motion in (
        MotionModel(
            "constant",
            "constant body rate on three axes",
            rate=lambda t, x, y, z: sp.Matrix([x, y, z]),
            increment=lambda m, d, x, y, z: d * sp.Matrix([x, y, z]),
            attitude=lambda t, x, y, z: algebra.rotation(t * sp.Matrix([x, y, z])),
            turning=lambda x, y, z: sp.zeros(3, 1),
        ),
        MotionModel(
            "sinusoidal",
            "rate a cos(b t) on the y axis",
            rate=lambda t, a, b: sp.Matrix([0, a * sp.cos(b * t), 0]),
            increment=lambda m, d, a, b: sp.Matrix([0, a * _chord(m, d, b, sp.cos), 0]),
            attitude=lambda t, a, b: _about_y(a * t * sp.sinc(b * t)),
        ),
        MotionModel(
            "coning",
            "coning on a constant pitch rate: rate (a sin(b t), g, a cos(b t))",
            rate=lambda t, a, b, g: sp.Matrix([a * sp.sin(b * t), g, a * sp.cos(b * t)]),
            increment=lambda m, d, a, b, g: sp.Matrix(
                [a * _chord(m, d, b, sp.sin), g * d, a * _chord(m, d, b, sp.cos)]
            ),
            attitude=_coning_attitude,
            turning=lambda a, b, g: sp.Matrix([0, b, 0]),
        ),
        MotionModel(
            "polynomial",
            "rate a0 + a1 t + a2 t^2 + a3 t^3 + a4 t^4 on the y axis",
            rate=lambda t, *a: sp.Matrix([0, sp.diff(_polynomial_angle(t, *a), t), 0]),
            increment=lambda m, d, *a: sp.Matrix([0, _polynomial_increment(m, d, *a), 0]),
            attitude=lambda t, *a: _about_y(_polynomial_angle(t, *a)),
        ),
    )
}


def _parameters(build: KernelBuilder, motion: MotionModel) -> list[sp.Symbol]:
    return [
        build.scalar(Signal.scalar(name, unit=unit, meaning=f"parameter of the rate, {motion.title}"))
        for name, unit in MOTION_PARAMETERS[motion.name].items()
    ]


def truth(name: str) -> Kernel:
    """Derive the body rate in rad/s and the attitude, body to reference, of a motion at an instant."""
    motion = MOTIONS[name]
    build = KernelBuilder()
    t = build.scalar(Signal.scalar("time", unit="s", meaning="time since the identity attitude"))
    parameters = _parameters(build, motion)
    build.output(
        Signal.vector("rate", "rate", unit="rad/s", meaning="body rate, body axes", frame="b"),
        motion.rate(t, *parameters),
    )
    build.output(
        Signal.matrix("attitude", "C", meaning=DCM_MEANING, frame="b to n"), motion.attitude(t, *parameters)
    )
    return build.kernel(
        f"{name}-truth", f"True attitude: {motion.title}", f"{THESIS}, chapter 4 B and appendix A"
    )


def increments(name: str) -> Kernel:
    """Derive the exact angle increment in rad, body axes, of a motion over an interval."""
    motion = MOTIONS[name]
    build = KernelBuilder()
    m = build.scalar(Signal.scalar("middle", unit="s", meaning="middle of the interval"))
    d = build.scalar(Signal.scalar("width", unit="s", meaning="width of the interval"))
    parameters = _parameters(build, motion)
    build.output(
        Signal.vector(
            "increment",
            "increment",
            unit="rad",
            meaning="angle increment over the interval, body axes",
            frame="b",
            over="cycle",
        ),
        motion.increment(m, d, *parameters),
    )
    return build.kernel(
        f"{name}-increments", f"Exact angle increments: {motion.title}", f"{THESIS}, chapter 4 B"
    )
