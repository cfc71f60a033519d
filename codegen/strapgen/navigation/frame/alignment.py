"""Derives the coarse alignment at rest, and the correction for a latitude that is entered late."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.conversions import ANGLES
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import DERIVED, GEOGRAPHIC, SIDEREAL_RATE
from strapgen.navigation.frame.geographic import ATTITUDE

VERTICAL = Signal.vector(
    "vertical",
    "f",
    unit="1",
    meaning="mean specific force at rest over gravity, which points up, body axes b",
    bound=Fraction(1),
    constraint="unit",
    frame="b",
)
ANGLE_SUM = Signal.vector(
    "angle_sum",
    "beta",
    unit="rad",
    meaning="sum of the angle increments at rest, body axes b",
    bound=Fraction(1, 65),
    frame="b",
)
LEVEL = Signal(
    "level",
    (2,),
    ("roll", "pitch"),
    unit="rad",
    meaning="roll and pitch of body axes b",
    bound=ANGLES.bound,
    frame="b to g",
)
LEVEL_ANGLES = Signal(
    "level_angles",
    (3,),
    ("ahead", "right", "down"),
    unit="rad",
    meaning="sum of the angle increments at rest, axes ahead, right and down, level with heading 0",
    bound=Fraction(1, 33),
)
TIME = Signal.scalar(
    "time", unit="s", meaning="time of the alignment without latitude, no frame", bound=Fraction(4000)
)


def coarse_leveling() -> Kernel:
    """Return roll and pitch at rest, and the earth's rotation in level axes: the first part of the gyrocompass."""
    build = KernelBuilder()
    f, beta = build.input(VERTICAL), build.input(ANGLE_SUM)
    roll = build.value("level_roll", sp.atan2(-f[1], -f[2]), "roll")
    across = build.value("across", sp.sqrt(f[1] ** 2 + f[2] ** 2), "specific force across the roll axis")
    pitch = build.value("level_pitch", sp.atan2(f[0], across), "pitch")
    (cr, sr), (cp, s) = (
        (build.value(f"cos_{name}", sp.cos(angle)), build.value(f"sin_{name}", sp.sin(angle)))
        for name, angle in (("roll", roll), ("pitch", pitch))
    )
    below = build.value("below", sr * beta[1] + cr * beta[2], "across roll and right axis")
    build.output(LEVEL, [roll, pitch])
    build.output(
        LEVEL_ANGLES, [cp * beta[0] + s * below, cr * beta[1] - sr * beta[2], cp * below - s * beta[0]]
    )
    return build.kernel(
        "coarse-leveling",
        "Roll and pitch at rest, and the earth's rotation in level axes",
        DERIVED,
        notes=("Where the roll axis is vertical, roll and heading are not determined separately.",),
    )


def coarse_azimuth() -> Kernel:
    """Return the angles of the attitude at rest: the horizontal earth rate points north.

    Returns: inputs ``level`` (2,) in rad and ``level_angles`` (3,) in rad; output ``angles`` (3,) in rad: roll,
    pitch and heading against north, east and down.
    """
    build = KernelBuilder()
    level, beta = build.input(LEVEL), build.input(LEVEL_ANGLES)
    elements = tuple(f"aligned_{element}" for element in ANGLES.elements)
    build.output(
        replace(
            ANGLES,
            elements=elements,
            meaning="roll, pitch and heading of body axes b, from north, east, down",
            frame="b to g",
        ),
        [*level, sp.atan2(-beta[1], beta[0])],
    )
    return build.kernel(
        "coarse-azimuth",
        "Attitude at rest by the analytic gyrocompass",
        DERIVED,
        notes=(
            "At a pole of the earth heading is not determined.",
            "dcm-from-euler-angles and dcm-north-east-down make the attitude of these angles.",
        ),
    )


def late_latitude() -> Kernel:
    """Return the attitude after an alignment without the vertical earth rate, once latitude is known.

    Such a frame is left behind by We sin(latitude) t about up.
    """
    build = KernelBuilder()
    C = build.input(ATTITUDE)
    latitude = build.input(GEOGRAPHIC)[0]
    rate, time = build.scalar(SIDEREAL_RATE), build.scalar(TIME)
    sine = build.value("sin_latitude", sp.sin(latitude))
    angle = build.value("left_behind", rate * time * sine, "angle that the frame is behind by, about up")
    c, s = build.value("cos_behind", sp.cos(angle)), build.value("sin_behind", sp.sin(angle))
    build.output(after(ATTITUDE), sp.Matrix([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * C)
    return build.kernel(
        "late-latitude",
        "Attitude corrected for a latitude that is entered late",
        DERIVED,
        recursion=Recursion((("state", "next_state"),), retained=("state",)),
    )
