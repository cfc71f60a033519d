"""Derives the step of the heading loop, and the heading of an attitude for it."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from strapgen.catalogue.kinematics import DCM
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE
from strapgen.navigation.loops.loop_signals import (
    HEADING,
    HEADING_BIAS,
    HEADING_GAINS,
    HEADING_RATE,
    LTR81,
    MAGNETIC_HEADING,
)


def heading_loop() -> Kernel:
    """Return a cycle of the heading loop: u_z = B + K1 e, B' = K2 e, e the heading less that of the reference.

    Returns: inputs ``heading`` and ``magnetic_heading`` in rad, ``heading_bias`` in rad/s, a state, ``k1`` in
    1/s, ``k2`` in 1/s^2, ``cycle`` in s; outputs ``next_heading_bias`` and ``heading_rate`` in rad/s.
    """
    build = KernelBuilder()
    heading, magnetic, bias = map(build.scalar, (HEADING, MAGNETIC_HEADING, HEADING_BIAS))
    k1, k2 = map(build.scalar, HEADING_GAINS)
    cycle = build.scalar(CYCLE)
    error = build.stage(
        Signal.scalar("heading_error", unit="rad", meaning="heading less that of the reference, -pi to pi"),
        [Wrapped(heading - magnetic)],
    )[0]
    build.output(after(HEADING_BIAS), [bias + cycle * k2 * error])
    build.output(HEADING_RATE, [bias + k1 * error])
    return build.kernel(
        "heading-loop",
        "Heading loop of second order",
        LTR81,
        recursion=Recursion(
            ((HEADING_BIAS.name, after(HEADING_BIAS).name),),
            retained=(HEADING_BIAS.name,),
        ),
        notes=(
            "Forward Euler: poles at -1/tau become 1 - T/tau, and a steady state stays exactly the same.",
            "With both gains zero the loop is open, and holds its bias: a directional gyro.",
        ),
    )


def heading_of_attitude() -> Kernel:
    """Return the heading of an attitude whose level frame has z down, atan2(C_21, C_11)."""
    build = KernelBuilder()
    C = build.input(replace(DCM.state, name="attitude"))
    build.output(replace(HEADING, bound=None), [sp.atan2(C[1, 0], C[0, 0])])
    return build.kernel("heading-from-dcm", "Heading of an attitude", LTR81)
