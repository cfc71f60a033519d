"""Derives the outputs of a navigator: latitude, longitude and wander angle, attitude and velocity against north."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.conversions import ANGLES, followed_angles
from strapgen.catalogue.kinematics import DCM
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import DERIVED, GEOGRAPHIC, POSITION, SIDEREAL_RATE, VELOCITY

#: Attitude, body to navigation axes, and to north, east and down.
ATTITUDE = replace(
    DCM.state, meaning="attitude C_b^n, direction cosine matrix from body axes b to navigation axes n"
)


def geographic_angles() -> Kernel:
    """Return latitude, longitude and wander angle of a position.

    Columns z, x, y of C_n^e are a rotation whose heading is longitude, whose pitch is minus latitude and whose roll is
    the wander angle, so that they are as accurate at a pole as there: (61) to (63) of Savage.
    """
    build = KernelBuilder()
    P = build.input(POSITION)
    elements = tuple(f"last_{element}" for element in GEOGRAPHIC.elements)
    previous = replace(GEOGRAPHIC, name="previous", elements=elements, meaning="the angles before, axes n")
    before = build.input(previous)
    turned = sp.Matrix.hstack(P[:, 2], P[:, 0], P[:, 1])
    wander, dip, longitude = followed_angles(build, turned, before[2], ("wander", "dip", "longitude"))
    elements = tuple(f"next_{element}_angle" for element in GEOGRAPHIC.elements)
    build.feedback(previous, [-dip, longitude, wander], replace(GEOGRAPHIC, name="next", elements=elements))
    return build.kernel(
        "geographic-angles",
        "Latitude, longitude and wander angle of a position",
        DERIVED,
        notes=(
            "At a pole only longitude and wander angle together are determined; the wander angle is held there.",
            "Errors of angles are told without whole turns.",
        ),
    )


def _cosines(build: KernelBuilder, angles: sp.Matrix) -> list[tuple[sp.Symbol, sp.Symbol]]:
    """Name cosine and sine of latitude, longitude and wander angle."""
    return [
        (build.value(f"cos_{name}", sp.cos(angle)), build.value(f"sin_{name}", sp.sin(angle)))
        for name, angle in zip(GEOGRAPHIC.elements, angles, strict=True)
    ]


def _wander(build: KernelBuilder) -> tuple[sp.Symbol, sp.Symbol]:
    """Declare the geographic angles as an input, and name cosine and sine of the wander angle."""
    wander = build.input(GEOGRAPHIC)[2]
    return build.value("cos_wander", sp.cos(wander)), build.value("sin_wander", sp.sin(wander))


def position_from_angles() -> Kernel:
    """Return the position of latitude, longitude and wander angle, with which a run begins.

    Returns: input ``geographic`` (3,) in rad; output ``position`` (3, 3), C_n^e.
    """
    build = KernelBuilder()
    (cl, sl), (co, so), (ca, sa) = _cosines(build, build.input(GEOGRAPHIC))
    east, north = sp.Matrix([-so, co, 0]), sp.Matrix([-sl * co, -sl * so, cl])
    up = sp.Matrix([cl * co, cl * so, sl])
    build.output(POSITION, sp.Matrix.hstack(ca * east + sa * north, ca * north - sa * east, up))
    return build.kernel("position-from-angles", "Position of latitude, longitude and wander angle", DERIVED)


def north_east_down(inverse: bool = False) -> Kernel:
    """Return the attitude against north, east and down, of which `euler-angles-from-dcm` has roll, pitch and heading.

    `inverse`: whether to return the attitude against axes n instead; the matrix between both is its own
    inverse. Returns: inputs ``state`` (3, 3), C_b^n, and ``geographic`` (3,) in rad; output ``attitude`` (3,
    3), body to north, east and down. For the inverse the input is ``attitude`` and the output ``state``.
    """
    build = KernelBuilder()
    words = "attitude, direction cosine matrix from body axes b to north, east and down"
    other = replace(ATTITUDE, name="attitude", elements=_renamed("D"), meaning=words, frame="b to g")
    before, result = (other, ATTITUDE) if inverse else (ATTITUDE, other)
    C = build.input(before)
    cosine, sine = _wander(build)
    exchange = sp.Matrix([[sine, cosine, 0], [cosine, -sine, 0], [0, 0, -1]])
    build.output(result, exchange * C)
    return build.kernel(
        "dcm-navigation-axes" if inverse else "dcm-north-east-down",
        f"Attitude against {'navigation axes' if inverse else 'north, east and down'}",
        DERIVED,
    )


def ground_velocity() -> Kernel:
    """Return the velocity to north, east and down.

    Returns: inputs ``velocity`` (3,) in m/s, axes n, and ``geographic`` (3,) in rad; output ``ground_velocity``
    (3,) in m/s.
    """
    build = KernelBuilder()
    v = build.input(VELOCITY)
    cosine, sine = _wander(build)
    signal = Signal(
        "ground_velocity",
        (3,),
        ("north_velocity", "east_velocity", "down_velocity"),
        unit="m/s",
        meaning="velocity relative to the earth, axes to north, east and down",
        frame="g",
    )
    build.output(signal, [sine * v[0] + cosine * v[1], cosine * v[0] - sine * v[1], -v[2]])
    return build.kernel("ground-velocity", "Velocity to north, east and down", DERIVED)


def _renamed(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}_{row}{column}" for row in "123" for column in "123")


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
    build.feedback(ATTITUDE, sp.Matrix([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * C)
    return build.kernel(
        "late-latitude",
        "Attitude corrected for a latitude that is entered late",
        DERIVED,
    )
