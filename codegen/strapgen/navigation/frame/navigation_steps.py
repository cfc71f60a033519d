"""Derives the steps of velocity, position and height over a cycle of the navigation frame."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import DCM
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import (
    ACCELERATION,
    DERIVED,
    EARTH_RATE,
    GRAVITY,
    HEIGHT,
    POSITION,
    TRANSPORT_RATE,
    VELOCITY,
)
from strapgen.navigation.instruments.imu_errors import CYCLE

#: The integral of specific force that the navigation loop hands on, equation (59) of Savage in it.
VELOCITY_CHANGE = Signal.vector(
    "velocity_change",
    "change",
    unit="m/s",
    meaning="integral of the specific force over the navigation cycle, navigation axes n as they turn",
    bound=Fraction(60),
    frame="n",
    over="cycle",
)
_START = (
    "The states named previous begin with the rates of the start; a zero there costs an error of first order."
)


def _previous(signal: Signal) -> Signal:
    """Return the signal of a rate one cycle before."""
    return replace(
        signal,
        name=f"previous_{signal.name}",
        elements=tuple(f"previous_{element}" for element in signal.elements),
        meaning=f"{signal.meaning.replace(' at the start of the cycle', '')}, one cycle before",
    )


PREVIOUS_ACCELERATION, PREVIOUS_TRANSPORT_RATE = map(_previous, (ACCELERATION, TRANSPORT_RATE))


def midpoint(rate: sp.Matrix, before: sp.Matrix) -> sp.Matrix:
    """Return a rate in the middle of a cycle, extrapolated from that at its start and that of the cycle before."""
    return (3 * rate - before) / 2


def coriolis_gravity() -> Kernel:
    """Return what changes the velocity beside the specific force, g_n - (2 Wn + rho) x v."""
    build = KernelBuilder()
    v, g, W, rho = map(build.input, (VELOCITY, GRAVITY, EARTH_RATE, TRANSPORT_RATE))
    build.output(ACCELERATION, g - cross(2 * W + rho, v))
    return build.kernel("coriolis-gravity", "Gravity and Coriolis acceleration", DERIVED)


def velocity_step(level: bool = False) -> Kernel:
    """Return the velocity after a cycle: specific force integrated, gravity and Coriolis by extrapolation to mid-cycle.

    Returns: inputs ``velocity`` (3,) in m/s, ``previous_acceleration`` and ``acceleration`` (3,) in m/s^2,
    ``velocity_change`` (3,) in m/s, all axes n, ``cycle`` in s; outputs ``next_velocity`` and
    ``next_previous_acceleration``.
    """
    build = KernelBuilder()
    v, before, a, change = map(build.input, (VELOCITY, PREVIOUS_ACCELERATION, ACCELERATION, VELOCITY_CHANGE))
    later = v + change + build.scalar(CYCLE) * midpoint(a, before)
    if level:
        later[2] = v[2]
    build.output(after(VELOCITY), later)
    build.output(after(PREVIOUS_ACCELERATION), a)
    return build.kernel(
        "velocity-step-level" if level else "velocity-step",
        f"Velocity after a cycle{', the vertical one held' if level else ''}",
        DERIVED,
        recursion=_recursion(VELOCITY, PREVIOUS_ACCELERATION),
        notes=(_START,),
    )


def position_step() -> Kernel:
    """Return the position after a cycle, C_n^e (I + [zeta x] + [zeta x]^2/2), zeta = T (3 rho - previous rho)/2."""
    build = KernelBuilder()
    position, before, rho = map(build.input, (POSITION, PREVIOUS_TRANSPORT_RATE, TRANSPORT_RATE))
    zeta = build.stage(
        Signal.vector("zeta", "zeta", unit="rad", meaning="rotation of n over the earth, axes n", frame="n"),
        build.scalar(CYCLE) * midpoint(rho, before),
    )
    turned = build.stage(replace(DCM.transition, constraint="", frame="n to n"), DCM.exponential(zeta, 2))
    build.output(after(POSITION), position * turned)
    build.output(after(PREVIOUS_TRANSPORT_RATE), rho)
    return build.kernel(
        "position-step",
        "Position after a cycle",
        DERIVED,
        recursion=_recursion(POSITION, PREVIOUS_TRANSPORT_RATE),
        notes=(
            _START,
            "Products of three elements of the rotation are left out: below 1e-15 rad for a cycle of 0.1 s.",
        ),
    )


def height_step() -> Kernel:
    """Return the height after a cycle, by the trapezoidal rule.

    Returns: inputs ``height`` in m, ``velocity`` and ``next_velocity`` (3,) in m/s, axes n, ``cycle`` in s;
    output ``next_height`` in m.
    """
    build = KernelBuilder()
    height = build.scalar(HEIGHT)
    v, later = build.input(VELOCITY), build.input(replace(after(VELOCITY), bound=VELOCITY.bound))
    build.output(after(HEIGHT), [height + build.scalar(CYCLE) * (v[2] + later[2]) / 2])
    return build.kernel("height-step", "Height after a cycle", DERIVED, recursion=_recursion(HEIGHT))


def _recursion(*states: Signal) -> Recursion:
    """Return the recursion of states that no slower loop resets."""
    return Recursion(
        tuple((signal.name, after(signal).name) for signal in states), retained=tuple(s.name for s in states)
    )
