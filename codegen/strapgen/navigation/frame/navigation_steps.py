"""Derives the steps of velocity, position and height over a cycle of the navigation frame."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.two_speed_kernels import (
    NAVIGATION_ROTATION,
    ROTATION_VECTOR,
    rotated,
    transition,
)
from strapgen.catalogue.kernels.velocity_position import CHANGES
from strapgen.catalogue.kinematics import DCM, KINEMATICS, SAVAGE, UNIT
from strapgen.ir.signals import Signal, after
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import (
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
    """Return the change of velocity by gravity and Coriolis acceleration, g_n - (2 Wn + rho) x v."""
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
    build.feedback(VELOCITY, later)
    build.feedback(PREVIOUS_ACCELERATION, a)
    return build.kernel(
        "velocity-step-level" if level else "velocity-step",
        f"Velocity after a cycle{', the vertical one held' if level else ''}",
        DERIVED,
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
    build.feedback(POSITION, position * turned)
    build.feedback(PREVIOUS_TRANSPORT_RATE, rho)
    return build.kernel(
        "position-step",
        "Position after a cycle",
        DERIVED,
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
    build.feedback(HEIGHT, [height + build.scalar(CYCLE) * (v[2] + later[2]) / 2])
    return build.kernel("height-step", "Height after a cycle", DERIVED)


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
    build.feedback(VELOCITY, v + turned[:, 0] + cycle * g)
    build.feedback(DISPLACEMENT, r + cycle * (v + turned[:, 1] + cycle * g / 2))
    return build.kernel(
        f"{name}-translation",
        "Velocity and position after a step, in axes that do not turn",
        f"derived: the integrals of {SAVAGE}, equations (44) and (57)",
    )


#: The rows: the navigation axes x and y in body axes.
ROWS = tuple(
    Signal.vector(
        name,
        name,
        meaning=f"{number} row of the attitude, {axis} of n in body axes",
        bound=UNIT,
        constraint="unit",
        frame="b",
    )
    for name, number, axis in (("row_1", "first", "x"), ("row_2", "second", "y"))
)
_TITLE = "Two rows of the direction cosine matrix"


def _third(rows: list[sp.Matrix]) -> sp.Matrix:
    """Return the third row as a column, equation (43)."""
    return algebra.cross(*rows)


def update(order: int | None = None) -> Kernel:
    """Return the kernel that rotates two rows by the rotation vector of a cycle, equations (2) to (4)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    turned = transition(build, DCM, build.input(ROTATION_VECTOR), order)
    for signal, row in zip(ROWS, rows, strict=True):
        build.feedback(signal, row.T * turned)
    return build.kernel(
        "dcm-two-rows-update" + (f"-{order}" if order else ""),
        f"{_TITLE}: update by a rotation vector" + (f", order {order}" if order else ", exact"),
        f"{SAVAGE}, equations (2) to (4) for two rows, as section 3.6 says",
    )


def navigation(order: int | None = None) -> Kernel:
    """Return the kernel that refers two rows to the rotated navigation frame, equations (5), (6) and (43)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    turn = transition(build, DCM, -build.input(NAVIGATION_ROTATION), order, "n")
    third = build.stage(
        Signal.vector("row_3", "row_3", meaning="third row of the attitude", frame="b"), _third(rows)
    )
    matrix = sp.Matrix.vstack(*(row.T for row in (*rows, third)))
    for number, signal in enumerate(ROWS):
        build.feedback(signal, turn[number, :] * matrix)
    return build.kernel(
        "dcm-two-rows-navigation" + (f"-{order}" if order else ""),
        f"{_TITLE}: update by the rotation of the navigation frame" + (f", order {order}" if order else ""),
        f"{SAVAGE}, equations (5), (6) and (43) for two rows",
    )


def orthonormalized() -> Kernel:
    """Return two rows made orthonormal to first order, equations (28) to (31)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    half = build.value("half_error", algebra.dot(*rows) / 2, "half the rows' product")
    factors = [
        build.value(
            f"factor_{number}", 1 + (1 - algebra.dot(row, row)) / 2, f"1/|row {number}| to first order"
        )
        for number, row in enumerate(rows, 1)
    ]
    for signal, row, other, factor in zip(ROWS, rows, rows[::-1], factors, strict=True):
        build.output(after(signal), factor * row - half * other)
    return build.kernel(
        "dcm-two-rows-orthonormalize",
        f"{_TITLE}: made orthonormal, to first order",
        f"{SAVAGE}, equations (28) to (31) for two rows, both corrected from the same rows",
        notes=("Made for rows near orthonormal ones.",),
    )


def matrix() -> Kernel:
    """Return the direction cosine matrix of two rows, equation (43)."""
    build = KernelBuilder()
    rows = [build.input(row) for row in ROWS]
    attitude = replace(DCM.state, name="attitude")
    build.output(attitude, sp.Matrix.vstack(*(row.T for row in (*rows, _third(rows)))))
    return build.kernel(
        "dcm-from-two-rows", "Direction cosine matrix from two rows", f"{SAVAGE}, equation (43)"
    )
