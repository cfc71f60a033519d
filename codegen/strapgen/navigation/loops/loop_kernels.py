"""The loops of an attitude and heading reference, whose level frame n has its z axis down, as kernels."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import DCM
from strapgen.ir.signals import CYCLE, Signal
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import CURVATURE, FENNER
from strapgen.navigation.instruments.imu_errors import CYCLE as LENGTH

LTR81 = (
    "the paper on the LTR-81 attitude and heading reference system, AGARD Lecture Series 133 (1984); "
    "diagrams lost, loops and gains derived"
)

VELOCITY_CHANGE = Signal.vector(
    "velocity_change",
    "change",
    unit="m/s",
    meaning="integral of the specific force over the cycle, level axes n, z down",
    bound=Fraction(2),
    frame="n",
    over=CYCLE,
)
LEVEL_VELOCITY = Signal.labelled(
    "level_velocity",
    "V",
    "xy",
    unit="m/s",
    meaning="velocity of the levelling loop, level axes n",
    bound=Fraction(512),
    frame="n",
)
REFERENCE_VELOCITY = Signal.labelled(
    "reference_velocity",
    "Vr",
    "xy",
    unit="m/s",
    meaning="velocity to compare with: zero at rest, true airspeed in flight; level axes n",
    bound=Fraction(512),
    frame="n",
)
LEVEL_BIAS = Signal.labelled(
    "level_bias",
    "B",
    "xy",
    unit="rad/s",
    meaning="estimate of earth rate and gyro bias, level axes n",
    bound=Fraction(1, 128),
    frame="n",
)
LEVEL_RATE = Signal.labelled(
    "level_rate",
    "u",
    "xy",
    unit="rad/s",
    meaning="commanded rate of the level frame about its level axes, until the next call; axes n",
    bound=Fraction(1, 4),
    frame="n",
)
HEADING = Signal.scalar(
    "heading", unit="rad", meaning="computed heading, positive about down", bound=Fraction(355, 113)
)
MAGNETIC_HEADING = Signal.scalar(
    "magnetic_heading",
    unit="rad",
    meaning="heading of the flux valve to compare with",
    bound=Fraction(355, 113),
)
HEADING_BIAS = Signal.scalar(
    "heading_bias",
    unit="rad/s",
    meaning="estimate of earth rate and gyro bias about down",
    bound=Fraction(1, 128),
)
HEADING_RATE = Signal.scalar(
    "heading_rate",
    unit="rad/s",
    meaning="commanded rate of the level frame about down, until the next call",
    bound=Fraction(1, 4),
)
HEIGHT = Signal.scalar("height", unit="m", meaning="height of the vertical loop", bound=Fraction(20_000))
REFERENCE_HEIGHT = Signal.scalar(
    "reference_height", unit="m", meaning="height of the air data to compare with", bound=Fraction(20_000)
)
CLIMB = Signal.scalar("climb", unit="m/s", meaning="vertical velocity, positive up", bound=Fraction(512))
VERTICAL_BIAS = Signal.scalar(
    "vertical_bias",
    unit="m/s^2",
    meaning="estimate of the accelerometer's bias along up",
    bound=Fraction(1),
)
GRAVITY = Signal.scalar("gravity", unit="m/s^2", meaning="gravity at zero height", bound=Fraction(10))
GRADIENT = Signal.scalar(
    "gravity_gradient",
    unit="1/s^2",
    meaning="2 g/R, by which gravity decreases with height",
    bound=Fraction(1, 262144),
)
_ERROR = "height of the barometer less that of the filter"


def _gain(name: str, unit: str, meaning: str, bound: Fraction) -> Signal:
    """Return the signal of a gain, which a schedule may change from call to call."""
    return Signal.scalar(name, unit=unit, meaning=meaning, bound=bound)


#: Gains of the levelling loop and of erection: velocity, attitude and bias.
LEVEL_GAINS = (
    _gain("k1", "1/s", "gain from the velocity error to the acceleration", Fraction(2)),
    _gain("k2", "rad/m", "gain from the velocity error to the rate of the frame", Fraction(1, 8)),
    _gain("k3", "rad/(m s)", "gain from the velocity error to the change of the bias", Fraction(1, 64)),
)
#: Gains of the heading loop: heading and bias.
HEADING_GAINS = (
    _gain("k1", "1/s", "gain from the heading error to the rate of the frame", Fraction(2)),
    _gain("k2", "1/s^2", "gain from the heading error to the change of the bias", Fraction(1)),
)
#: Gains of the vertical loop: height, velocity and bias.
VERTICAL_GAINS = (
    _gain("k1", "1/s", "gain from the height error to the climb", Fraction(2)),
    _gain("k2", "1/s^2", "gain from the height error to the acceleration", Fraction(2)),
    _gain("k3", "1/s^3", "gain from the height error to the change of the bias", Fraction(1)),
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
    cycle = build.scalar(LENGTH)
    velocity = build.feedback(LEVEL_VELOCITY, V + change[:2, :] - cycle * k1 * (V - Vr))
    bias = build.feedback(LEVEL_BIAS, B + cycle * k3 * _about_level(V - Vr))
    build.output(LEVEL_RATE, _about_level(curvature * velocity) + k2 * _about_level(velocity - Vr) + bias)
    return build.kernel(
        "level-loop",
        "Levelling loop of third order",
        LTR81,
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
    cycle = build.scalar(LENGTH)
    velocity = build.feedback(LEVEL_VELOCITY, V + change[:2, :] - cycle * k1 * V)
    build.output(LEVEL_RATE, k2 * _about_level(velocity))
    return build.kernel(
        "erection",
        "Erection loop of the attitude mode",
        LTR81,
        notes=(_EULER,),
    )


def heading_loop() -> Kernel:
    """Return a cycle of the heading loop: u_z = B + K1 e, B' = K2 e, e the heading less that of the reference.

    Returns: inputs ``heading`` and ``magnetic_heading`` in rad, ``heading_bias`` in rad/s, a state, ``k1`` in
    1/s, ``k2`` in 1/s^2, ``cycle`` in s; outputs ``next_heading_bias`` and ``heading_rate`` in rad/s.
    """
    build = KernelBuilder()
    heading, magnetic, bias = map(build.scalar, (HEADING, MAGNETIC_HEADING, HEADING_BIAS))
    k1, k2 = map(build.scalar, HEADING_GAINS)
    cycle = build.scalar(LENGTH)
    error = build.stage(
        Signal.scalar("heading_error", unit="rad", meaning="heading less that of the reference, -pi to pi"),
        [Wrapped(heading - magnetic)],
    )[0]
    build.feedback(HEADING_BIAS, [bias + cycle * k2 * error])
    build.output(HEADING_RATE, [bias + k1 * error])
    return build.kernel(
        "heading-loop",
        "Heading loop of second order",
        LTR81,
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
    height, climb, bias = map(build.scalar, (HEIGHT, CLIMB, VERTICAL_BIAS))
    change = build.input(VELOCITY_CHANGE)
    reference, gravity, gradient = map(build.scalar, (REFERENCE_HEIGHT, GRAVITY, GRADIENT))
    k1, k2, k3 = map(build.scalar, VERTICAL_GAINS)
    cycle = build.scalar(LENGTH)
    error = height - reference
    build.feedback(HEIGHT, [height + cycle * (climb - k1 * error)])
    build.feedback(
        CLIMB,
        [climb - change[2] + cycle * (gradient * height - gravity - k2 * error - bias)],
    )
    build.feedback(VERTICAL_BIAS, [bias + cycle * k3 * error])
    return build.kernel(
        "vertical-loop",
        "Vertical loop of third order",
        LTR81,
        notes=(
            "Forward Euler: poles at -1/tau become 1 - T/tau, and a steady state stays exactly the same.",
            "With k3 = 0 the loop is of second order, and holds its bias.",
        ),
    )


def height_hysteresis() -> Kernel:
    """Return the switch that limits the feedback of a height error, with hysteresis.

    It is on after an error of a magnitude above one limit, until one is at most the other. While it is on, climb and
    bias are left as they are, so that a step of the barometer does not enter them.

    Returns: inputs ``limited``, a state, 0 or 1, ``height_error`` in m, ``above`` and ``below`` in m; output
    ``next_limited``.

    >>> height_hysteresis().outputs[0].signal.name
    'next_limited'
    """
    build = KernelBuilder()
    switch = Signal.scalar(
        "limited", meaning="1 while the height alone is corrected, else 0", bound=Fraction(1)
    )
    limited = build.scalar(switch)
    error = build.scalar(replace(HEIGHT, name="height_error", elements=("height_error",), meaning=_ERROR))
    above, below = (
        build.scalar(Signal.scalar(name, unit="m", meaning=f"magnitude {what}", bound=HEIGHT.bound))
        for name, what in (("above", "above which it goes on"), ("below", "up to which it goes off"))
    )
    limit = build.value("limit", sp.Piecewise((below, limited >= sp.Rational(1, 2)), (above, True)))
    build.feedback(switch, [sp.Piecewise((0, limit >= sp.Abs(error)), (1, True))])
    return build.kernel(
        "height-hysteresis",
        "Hysteresis of the feedback of a height",
        f"{FENNER}, page 4-20 names its purpose; form lost in the scans, derived",
    )


_INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the cycle, body axes",
    bound=Fraction(1, 8),
    frame="b",
    over=CYCLE,
)


def body_feedback() -> Kernel:
    """Return the commanded rate of the level frame in body axes, -C' u, and the increment that has it added."""
    build = KernelBuilder()
    increment, C = build.input(_INCREMENT), build.input(replace(DCM.state, name="attitude"))
    level, heading = build.input(LEVEL_RATE), build.scalar(HEADING_RATE)
    cycle = build.scalar(LENGTH)
    rate = Signal.vector(
        "feedback_rate",
        "feedback",
        unit="rad/s",
        meaning="rate to add to that of the gyros: the commanded one of the frame, reversed; body axes",
        frame="b",
    )
    feedback = build.output(rate, -C.T * sp.Matrix([*level, heading]))
    corrected = replace(
        _INCREMENT,
        name="corrected_increment",
        elements=tuple(f"corrected_{axis}" for axis in "xyz"),
        meaning="angle increment of the cycle against the commanded frame, body axes",
        bound=None,
    )
    build.output(corrected, increment + cycle * feedback)
    return build.kernel(
        "body-feedback", "Feedback of the loops in body axes", f"{LTR81}; feedback as in Fig. 9"
    )
