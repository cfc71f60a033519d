"""Derives the steps of the levelling loop, in its full form and as erection without earth and transport rate."""

from __future__ import annotations

import sympy as sp

from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import CURVATURE
from strapgen.navigation.instruments.imu_errors import CYCLE
from strapgen.navigation.loops.loop_signals import (
    LEVEL_BIAS,
    LEVEL_GAINS,
    LEVEL_RATE,
    LEVEL_VELOCITY,
    LTR81,
    REFERENCE_VELOCITY,
    VELOCITY_CHANGE,
)

_EULER = (
    "Forward Euler, which leaves a steady state exactly as it is. The frame turns on between the calls: the poles, at "
    "-1/tau in continuous time, lie around 1 - T/tau."
)


def _about_level(along: sp.Matrix) -> sp.Matrix:
    """Return the rates that a velocity of the frame means over a sphere, z down: down x along, reversed."""
    return sp.Matrix([along[1], -along[0]])


def level_loop() -> Kernel:
    """Return a cycle of the levelling loop, both channels, z down.

    V' = f - K1 (V - Vr), u_x = V_y/R + K2 (V_y - Vr_y) + B_x, B_x' = K3 (V_y - Vr_y), and with the signs of the
    rates turned about y. The rate belongs to the cycle after the call.

    Returns: inputs ``level_velocity``, ``level_bias`` (2,), states, in m/s and rad/s, ``velocity_change`` (3,)
    and ``reference_velocity`` (2,) in m/s, all axes n, ``curvature`` 1/R in 1/m, ``k1``, ``k2``, ``k3``,
    ``cycle`` in s; outputs ``next_level_velocity``, ``next_level_bias`` and ``level_rate`` (2,) in rad/s.

    >>> level_loop().outputs[1].expressions[1]
    B_y + cycle*k3*(-V_x + Vr_x)
    """
    build = KernelBuilder()
    V, B = build.input(LEVEL_VELOCITY), build.input(LEVEL_BIAS)
    change, Vr = build.input(VELOCITY_CHANGE), build.input(REFERENCE_VELOCITY)
    curvature = build.scalar(CURVATURE)
    k1, k2, k3 = map(build.scalar, LEVEL_GAINS)
    cycle = build.scalar(CYCLE)
    velocity = build.output(after(LEVEL_VELOCITY), V + change[:2, :] - cycle * k1 * (V - Vr))
    bias = build.output(after(LEVEL_BIAS), B + cycle * k3 * _about_level(V - Vr))
    build.output(LEVEL_RATE, _about_level(curvature * velocity) + k2 * _about_level(velocity - Vr) + bias)
    return build.kernel(
        "level-loop",
        "Levelling loop of third order",
        LTR81,
        recursion=_recursion((LEVEL_VELOCITY.name, LEVEL_BIAS.name)),
        notes=(_EULER, "With k3 = 0 the loop is of second order, and holds its bias."),
    )


def erection() -> Kernel:
    """Return a cycle of the erection loop of the attitude mode, both channels, z down.

    V' = f - K1 V, u_x = K2 V_y, u_y = -K2 V_x: earth rate, transport rate and the bias are left out.

    Returns: inputs ``level_velocity`` (2,), a state, and ``velocity_change`` (3,) in m/s, axes n, ``k1``,
    ``k2`` and ``cycle`` in s; outputs ``next_level_velocity`` and ``level_rate`` (2,) in rad/s.
    """
    build = KernelBuilder()
    V, change = build.input(LEVEL_VELOCITY), build.input(VELOCITY_CHANGE)
    k1, k2 = map(build.scalar, LEVEL_GAINS[:2])
    cycle = build.scalar(CYCLE)
    velocity = build.output(after(LEVEL_VELOCITY), V + change[:2, :] - cycle * k1 * V)
    build.output(LEVEL_RATE, k2 * _about_level(velocity))
    return build.kernel(
        "erection",
        "Erection loop of the attitude mode",
        LTR81,
        recursion=_recursion((LEVEL_VELOCITY.name,)),
        notes=(_EULER,),
    )


def _recursion(names: tuple[str, ...]) -> Recursion:
    """Return the recursion of states that no slower loop resets."""
    return Recursion(tuple((name, f"next_{name}") for name in names), retained=names)
