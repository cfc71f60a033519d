"""Derives velocity and position after a step from its changes in body axes, in axes that do not turn."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.two_speed_kernels import rotated
from strapgen.catalogue.kernels.velocity_position import CHANGES
from strapgen.catalogue.kinematics import KINEMATICS, SAVAGE
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import GRAVITY, VELOCITY
from strapgen.navigation.instruments.imu_errors import CYCLE

#: The position of the body from where it began; the range of 8 km leaves 4 micrometres to words of 32 bits.
DISPLACEMENT = Signal.vector(
    "displacement",
    "r",
    unit="m",
    meaning="position of the body from the place of the start, navigation axes n",
    bound=Fraction(8192),
    frame="n",
)


def translation(name: str) -> Kernel:
    """Return velocity and position after a step: v + C dv + g T, and r + (v + C dr + g T/2) T.

    Returns: inputs ``state``, the attitude at the start of the step, ``velocity_change`` and
    ``position_change`` (3,) in m/s in body axes there, ``velocity`` (3,) in m/s, ``displacement`` (3,) in m and
    ``gravity`` (3,) in m/s^2, axes n, ``cycle`` in s; outputs ``next_velocity`` and ``next_displacement``.
    """
    build = KernelBuilder()
    state = build.input(KINEMATICS[name].state)
    changes = [build.input(replace(CHANGES[part], bound=Fraction(8))) for part in ("velocity", "position")]
    v, r, g = map(build.input, (VELOCITY, DISPLACEMENT, GRAVITY))
    cycle = build.scalar(CYCLE)
    change = sp.Matrix.hstack(*changes)
    turned = rotated(build, name, state, change)
    build.output(after(VELOCITY), v + turned[:, 0] + cycle * g)
    build.output(after(DISPLACEMENT), r + cycle * (v + turned[:, 1] + cycle * g / 2))
    return build.kernel(
        f"{name}-translation",
        "Velocity and position after a step, in axes that do not turn",
        f"derived: the integrals of {SAVAGE}, equations (44) and (57)",
        recursion=Recursion(
            ((VELOCITY.name, after(VELOCITY).name), (DISPLACEMENT.name, after(DISPLACEMENT).name)),
            retained=(VELOCITY.name, DISPLACEMENT.name),
        ),
    )
