"""Conversions between direction cosine matrix and Euler angles: rotations by heading, pitch, then roll."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import DCM, SAVAGE
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import ANY, Signal
from strapgen.kernel.algebra import Direction, Wrapped
from strapgen.kernel.kernel import EPSILON, Kernel, KernelBuilder

ANGLES = Signal(
    "angles",
    (3,),
    ("roll", "pitch", "heading"),
    unit="rad",
    meaning="Euler angles: roll, pitch, heading",
    bound=Fraction(355, 113),
    frame=ANY,
)
#: Squared cosine of pitch below which heading is computed from its sum or difference with roll.
_STEEP = sp.Rational(1, 4)
#: Cosine of pitch, in units of the resolution, up to which the matrix does not determine roll and heading separately.
_VERTICAL = 2


def dcm_from_euler_angles() -> Kernel:
    """Derive the direction cosine matrix of Euler angles, equation (60)."""
    build = KernelBuilder()
    roll, pitch, heading = build.input(ANGLES)

    def turned(angle: sp.Expr, name: str, axis: int) -> sp.Matrix:
        c, s = build.value(f"cos_{name}", sp.cos(angle)), build.value(f"sin_{name}", sp.sin(angle))
        matrix, (j, k) = sp.eye(3), ((1, 2), (2, 0), (0, 1))[axis]
        matrix[j, j] = matrix[k, k] = c
        matrix[k, j], matrix[j, k] = s, -s
        return matrix

    product = turned(heading, "heading", 2) * turned(pitch, "pitch", 1) * turned(roll, "roll", 0)
    build.output(replace(DCM.state, name="attitude", frame=ANY), product)
    return build.kernel(
        "dcm-from-euler-angles", "Direction cosine matrix from Euler angles", f"{SAVAGE}, equation (60)"
    )


def followed_angles(
    build: KernelBuilder, C: sp.Matrix, before: sp.Symbol, names: tuple[str, str, str]
) -> tuple[sp.Symbol, sp.Symbol, sp.Symbol]:
    """Name roll, pitch and heading of a rotation in rad, equations (61) to (63); a vertical pitch keeps `before`."""
    square = build.value("cosine_squared", C[0, 0] ** 2 + C[1, 0] ** 2, f"square of the cosine of {names[1]}")
    pitch = build.value(f"next_{names[1]}", sp.atan2(-C[2, 0], sp.sqrt(square)), names[1])
    vertical = (_VERTICAL * EPSILON) ** 2
    roll = build.value(
        f"next_{names[0]}",
        sp.Piecewise((before, square <= vertical), (sp.atan2(C[2, 1], C[2, 2]), True)),
        f"{names[0]}; held where {names[1]} is vertical",
    )
    up = C[2, 0] <= 0
    sine = build.value(
        "steep_sine",
        sp.Piecewise((C[1, 2] - C[0, 1], up), (-C[1, 2] - C[0, 1], True)),
        f"{names[2]} - {names[0]}, or +",
    )
    cosine = build.value("steep_cosine", sp.Piecewise((C[1, 1] + C[0, 2], up), (C[1, 1] - C[0, 2], True)))
    apart = build.value("apart", Direction(sine, cosine), "the angle between or together")
    heading = build.value(
        f"next_{names[2]}",
        sp.Piecewise(
            (sp.atan2(C[1, 0], C[0, 0]), square >= _STEEP),
            (Wrapped(apart + sp.Piecewise((roll, up), (-roll, True))), True),
        ),
        names[2],
    )
    return roll, pitch, heading


def euler_angles_from_dcm() -> Kernel:
    """Derive the Euler angles of a direction cosine matrix, equations (61) to (63).

    Equation (63) holds at every pitch: C23 - C12 and C13 + C22 are 1 + sin(pitch) times the sine and cosine of
    heading - roll. It is used at steep pitch, so that heading - roll (or their sum) is as accurate as the matrix even
    where neither angle is by itself. If the pitch is vertical to the last digit, roll does not change.
    """
    build = KernelBuilder()
    C = build.input(replace(DCM.state, frame=ANY))
    before = build.input(
        replace(
            ANGLES,
            name="previous",
            elements=tuple(f"last_{e}" for e in ANGLES.elements),
            meaning="the angles before",
        )
    )
    roll, pitch, heading = followed_angles(build, C, before[0], ("roll", "pitch", "heading"))
    build.output(
        replace(ANGLES, name="next", elements=tuple(f"found_{e}" for e in ANGLES.elements)),
        [roll, pitch, heading],
    )
    return build.kernel(
        "euler-angles-from-dcm",
        "Euler angles from a direction cosine matrix",
        f"{SAVAGE}, equations (61) to (63), the root of (61) of C11^2 + C21^2",
        recursion=Recursion((("previous", "next"),), retained=("previous",)),
        notes=(
            "Heading - roll at pitch up, heading + roll at pitch down, are as good as the matrix at every pitch.",
            "Errors of angles are told without whole turns.",
        ),
    )
