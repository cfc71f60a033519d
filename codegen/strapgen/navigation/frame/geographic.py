"""Derives what a navigator shows: latitude, longitude and wander angle, attitude and velocity against north."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from strapgen.catalogue.kernels.conversions import followed_angles
from strapgen.catalogue.kinematics import DCM
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import DERIVED, GEOGRAPHIC, POSITION, VELOCITY

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
    before = build.input(
        replace(GEOGRAPHIC, name="previous", elements=elements, meaning="the angles before, axes n")
    )
    turned = sp.Matrix.hstack(P[:, 2], P[:, 0], P[:, 1])
    wander, dip, longitude = followed_angles(build, turned, before[2], ("wander", "dip", "longitude"))
    elements = tuple(f"next_{element}_angle" for element in GEOGRAPHIC.elements)
    build.output(replace(GEOGRAPHIC, name="next", elements=elements), [-dip, longitude, wander])
    return build.kernel(
        "geographic-angles",
        "Latitude, longitude and wander angle of a position",
        DERIVED,
        recursion=Recursion((("previous", "next"),), retained=("previous",)),
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
