"""Derives the step of the vertical loop."""

from __future__ import annotations

from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE
from strapgen.navigation.loops.loop_signals import (
    CLIMB,
    GRADIENT,
    GRAVITY,
    HEIGHT,
    LTR81,
    REFERENCE_HEIGHT,
    VELOCITY_CHANGE,
    VERTICAL_BIAS,
    VERTICAL_GAINS,
)


def vertical_loop() -> Kernel:
    """Return a cycle of the vertical loop.

    h' = V - K1 (h - hr), V' = a + 2 (g/R) h - K2 (h - hr) - B, B' = K3 (h - hr), with h and V up and
    a = -f_z - g from the specific force along down.

    Returns: inputs ``height`` in m, ``climb`` in m/s, ``vertical_bias`` in m/s^2, states, ``velocity_change``
    (3,) in m/s, axes n, z down, ``reference_height`` in m, ``gravity`` in m/s^2, ``gravity_gradient`` 2 g/R in
    1/s^2, ``k1``, ``k2``, ``k3``, ``cycle`` in s; outputs ``next_height``, ``next_climb`` and
    ``next_vertical_bias``.
    """
    build = KernelBuilder()
    states = (HEIGHT, CLIMB, VERTICAL_BIAS)
    height, climb, bias = map(build.scalar, states)
    change = build.input(VELOCITY_CHANGE)
    reference, gravity, gradient = map(build.scalar, (REFERENCE_HEIGHT, GRAVITY, GRADIENT))
    k1, k2, k3 = map(build.scalar, VERTICAL_GAINS)
    cycle = build.scalar(CYCLE)
    error = height - reference
    build.output(after(HEIGHT), [height + cycle * (climb - k1 * error)])
    build.output(
        after(CLIMB),
        [climb - change[2] + cycle * (gradient * height - gravity - k2 * error - bias)],
    )
    build.output(after(VERTICAL_BIAS), [bias + cycle * k3 * error])
    names = tuple(signal.name for signal in states)
    return build.kernel(
        "vertical-loop",
        "Vertical loop of third order",
        LTR81,
        recursion=Recursion(tuple((name, f"next_{name}") for name in names), retained=names),
        notes=(
            "Forward Euler: poles at -1/tau become 1 - T/tau, and a steady state stays exactly the same.",
            "With k3 = 0 the loop is of second order, and holds its bias.",
        ),
    )
