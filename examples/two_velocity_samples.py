"""Velocity and position of a step from two increments of angle and velocity, whose coefficients are unknown."""

import sympy as sp

from strapgen import KernelBuilder, Signal, algebra, increments_signal, velocities_signal


def algorithm():
    """Return the step; a and b weigh the velocity's products of two times, c and k the terms of the position."""
    build = KernelBuilder()
    a, b, c1, c2, k11, k12, k21, k22 = sp.symbols("a b c1 c2 k11 k12 k21 k22")
    build.parameter(a, b, c1, c2, k11, k12, k21, k22)
    cross = algebra.cross
    increments, velocities = build.input(increments_signal(2)), build.input(velocities_signal(2))
    d1, d2 = (increments[k, :].T for k in range(2))
    v1, v2 = (velocities[k, :].T for k in range(2))
    turn = build.stage(
        Signal.vector("turn", "turn", unit="rad", meaning="sum of the angle increments"), d1 + d2
    )
    total = build.stage(Signal.vector("total", "total", unit="m/s", meaning="sum of the velocities"), v1 + v2)
    turned = build.stage(
        Signal.vector("turned", "turned", unit="m/s", meaning="turn x total"), cross(turn, total)
    )
    again = cross(turn, turned)
    build.output(
        Signal.vector("velocity_change", "dv", unit="m/s", meaning="velocity change, body axes at the start"),
        total + turned / 2 + again / 6 + a * cross(d1, v2) + b * cross(d2, v1),
    )
    build.output(
        Signal.vector(
            "position_change", "dr", unit="m/s", meaning="position change by the step, the same axes"
        ),
        c1 * v1
        + c2 * v2
        + k11 * cross(d1, v1)
        + k12 * cross(d1, v2)
        + k21 * cross(d2, v1)
        + k22 * cross(d2, v2)
        + again / 24,
    )
    return build.kernel(
        "two-velocity-samples",
        "Velocity and position change from two increments of angle and velocity",
        "P. G. Savage, J. Guid. Control Dyn. 21 (1998) 208-221",
    )
