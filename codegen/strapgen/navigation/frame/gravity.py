"""Derives gravity in navigation axes: of a turning sphere, and the normal gravity of an ellipsoid."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import (
    CURVATURE,
    DERIVED,
    ECCENTRICITY,
    GRAVITY,
    HEIGHT,
    POSITION,
)

SOMIGLIANA = "W. A. Heiskanen and H. Moritz, Physical Geodesy (1967), equations (2-78) and (2-123)"
GRAVITATION = Signal.scalar(
    "gravitation",
    unit="m/s^2",
    meaning="mu/R^2, gravitation on the sphere, along -z of n",
    bound=Fraction(12),
)
CENTRIFUGAL = Signal.scalar(
    "centrifugal",
    unit="m/s^2",
    meaning="We^2 R, centrifugal acceleration at the equator",
    bound=Fraction(1, 20),
)
EQUATOR = Signal.scalar(
    "equator_gravity",
    unit="m/s^2",
    meaning="normal gravity at the equator, along -z of n",
    bound=Fraction(12),
)
INCREASE = Signal.scalar(
    "gravity_increase",
    unit="1",
    meaning="k of Somigliana's formula, b gamma_p/(a gamma_e) - 1, no frame",
    bound=Fraction(1, 100),
)
FLATTENING = Signal.scalar(
    "flattening", unit="1", meaning="f of the meridian's ellipse, no frame", bound=Fraction(1, 100)
)
RATIO = Signal.scalar(
    "centrifugal_ratio", unit="1", meaning="m, We^2 a^2 b/mu, no frame", bound=Fraction(1, 100)
)


def gravity_sphere() -> Kernel:
    """Return the gravity of a turning sphere, (0, 0, -mu/r^2) - Wn x (Wn x (0, 0, r)).

    With c the third row of C_n^e the second part is -We^2 r (c_z c - (0, 0, 1)).
    """
    build = KernelBuilder()
    c = build.input(POSITION)[2, :].T
    height, curvature = build.scalar(HEIGHT), build.scalar(CURVATURE)
    gravitation, centrifugal = build.scalar(GRAVITATION), build.scalar(CENTRIFUGAL)
    ratio = build.value("radius_ratio", 1 + curvature * height, "r over R")
    outward = build.value("outward", centrifugal * ratio, "We^2 r in m/s^2")
    down = build.value("down", gravitation / ratio**2, "mu/r^2 in m/s^2")
    build.output(
        GRAVITY,
        [-outward * c[0] * c[2], -outward * c[1] * c[2], outward * (1 - c[2] ** 2) - down],
    )
    return build.kernel(
        "gravity-sphere",
        "Gravity of a turning sphere",
        DERIVED,
        notes=("mu/R^2 is gravitation alone; the centrifugal acceleration is added here, and nowhere else.",),
    )


def gravity_ellipsoid() -> Kernel:
    """Return the normal gravity of a level ellipsoid: Somigliana's formula, to second order in height.

    The height enters as gamma = gamma_0 (1 - 2 (f + m - 2 f sin^2) h/a)/(1 + h/a)^2, which is (2-123) of the source to
    second order in h/a and the flattening, and the sphere's inverse square where f and m are zero. The plumb line bends
    with height, so that gravity has the part -2 (h/a) gamma_e (k + e^2/2) sin cos along north, to first order: derived.
    """
    build = KernelBuilder()
    c = build.input(POSITION)[2, :].T
    height, curvature = build.scalar(HEIGHT), build.scalar(CURVATURE)
    eccentricity, equator, increase, flattening, ratio = map(
        build.scalar, (ECCENTRICITY, EQUATOR, INCREASE, FLATTENING, RATIO)
    )
    raised = build.value("relative_height", curvature * height, "height over the equatorial radius")
    square = build.value("sine_squared", c[2] ** 2, "square of the sine of latitude")
    surface = build.value(
        "surface",
        equator * (1 + increase * square) / sp.sqrt(1 - eccentricity * square),
        "at height 0, in m/s^2",
    )
    bend = build.value("flattened", flattening + ratio - 2 * flattening * square, "f + m - 2 f sin^2")
    down = build.value(
        "down", surface * (1 - 2 * raised * bend) / (1 + raised) ** 2, "at the height, in m/s^2"
    )
    south = build.value(
        "south",
        raised * equator * (2 * increase + eccentricity) * c[2],
        "over the cosine of latitude, in m/s^2",
    )
    build.output(GRAVITY, [-south * c[0], -south * c[1], -down])
    return build.kernel(
        "gravity-ellipsoid",
        "Normal gravity of an ellipsoid",
        f"{SOMIGLIANA}, printed; form of the height and part along north derived",
        notes=("The centrifugal acceleration is in it.",),
    )
