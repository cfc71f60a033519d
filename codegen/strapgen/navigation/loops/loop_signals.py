"""The signals of the loops of an attitude and heading reference, whose level frame n has its z axis down."""

from __future__ import annotations

from fractions import Fraction

from strapgen.ir.signals import CYCLE, Signal

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


def gain(name: str, unit: str, meaning: str, bound: Fraction) -> Signal:
    """Return the signal of a gain, which a schedule may change from call to call."""
    return Signal.scalar(name, unit=unit, meaning=meaning, bound=bound)


#: Gains of the levelling loop and of erection: velocity, attitude and bias.
LEVEL_GAINS = (
    gain("k1", "1/s", "gain from the velocity error to the acceleration", Fraction(2)),
    gain("k2", "rad/m", "gain from the velocity error to the rate of the frame", Fraction(1, 8)),
    gain("k3", "rad/(m s)", "gain from the velocity error to the change of the bias", Fraction(1, 64)),
)
#: Gains of the heading loop: heading and bias.
HEADING_GAINS = (
    gain("k1", "1/s", "gain from the heading error to the rate of the frame", Fraction(2)),
    gain("k2", "1/s^2", "gain from the heading error to the change of the bias", Fraction(1)),
)
#: Gains of the vertical loop: height, velocity and bias.
VERTICAL_GAINS = (
    gain("k1", "1/s", "gain from the height error to the climb", Fraction(2)),
    gain("k2", "1/s^2", "gain from the height error to the acceleration", Fraction(2)),
    gain("k3", "1/s^3", "gain from the height error to the change of the bias", Fraction(1)),
)
