"""Derives the rate of the navigation frame: earth rate, transport rate, and what both turn the frame by in a cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.two_speed_kernels import TURN
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import (
    CURVATURE,
    DERIVED,
    EARTH_RATE,
    ECCENTRICITY,
    HEIGHT,
    POSITION,
    SIDEREAL_RATE,
    TRANSPORT_RATE,
    VELOCITY,
)
from strapgen.navigation.instruments.imu_errors import CYCLE

#: Cosine of latitude below which the north-slaved frame no longer follows north: its rate would grow without limit.
STEEPEST = Fraction(1, 64)
#: What the third component of the transport rate is, by the name of the mode.
AZIMUTHS = {
    "wander": "wander azimuth: none about the vertical",
    "free": "free azimuth: the frame does not turn about the vertical against inertial axes i",
    "north": "north-slaved: y of n stays north",
}

PREVIOUS_RATE = Signal.vector(
    "previous_rate",
    "before",
    unit="rad/s",
    meaning="rate of the navigation frame one cycle before, navigation axes n",
    bound=Fraction(1, 2700),
    frame="n",
)
LEAD = Signal.scalar(
    "lead", unit="1", meaning="navigation cycles by which to extrapolate, 1/2 + 1/(2m)", bound=Fraction(1)
)


def earth_rate() -> Kernel:
    """Return the earth rate in navigation axes, Wn = C_n^e' (0, 0, We)."""
    build = KernelBuilder()
    position, rate = build.input(POSITION), build.scalar(SIDEREAL_RATE)
    build.output(EARTH_RATE, rate * position[2, :].T)
    return build.kernel("earth-rate", "Earth rate in navigation axes", DERIVED)


@dataclass(frozen=True)
class Curvatures:
    """Curvatures of the surface at a height, as they enter the transport rate without a singularity at the poles."""

    #: 1/(R_N + h) in 1/m, R_N the transverse radius
    transverse: sp.Expr
    #: (R_N - R_M)/((R_M + h) cos^2 latitude), R_M the meridian radius; 0 on a sphere
    excess: sp.Expr


def curvatures(build: KernelBuilder, shape: str, position: sp.Matrix, height: sp.Symbol) -> Curvatures:
    """Declare the constants of a shape, "sphere" or "ellipsoid", as inputs, and return its curvatures."""
    curvature = build.scalar(CURVATURE)
    if shape == "sphere":
        raised = build.value("relative_height", curvature * height, "height over the radius")
        return Curvatures(build.value("transverse", curvature / (1 + raised), "1/(R + h) in 1/m"), sp.S.Zero)
    eccentricity = build.scalar(ECCENTRICITY)
    raised = build.value("relative_height", curvature * height, "height over the equatorial radius")
    root = build.value(
        "root", sp.sqrt(1 - eccentricity * position[2, 2] ** 2), "equatorial over transverse radius"
    )
    transverse = build.value("transverse", curvature * root / (1 + raised * root), "1/(R_N + h) in 1/m")
    excess = build.value(
        "excess",
        eccentricity / (1 - eccentricity + raised * root**3),
        "(R_N - R_M)/((R_M + h) cos^2 latitude)",
    )
    return Curvatures(transverse, excess)


def transport_rate(shape: str, azimuth: str = "wander") -> Kernel:
    """Return the rate of the navigation frame over the earth, in one of the modes `AZIMUTHS`.

    On an ellipsoid, with u = (C31, C32) the horizontal part of the earth's axis in n, the rate is
    (-v_y - k (u v) C32, v_x + k (u v) C31)/(R_N + h), k = (R_N - R_M)/((R_M + h) cos^2 latitude). Nothing of it is
    singular at the poles, since u is the cosine of latitude times the direction of north.
    """
    build = KernelBuilder()
    P, v = build.input(POSITION), build.input(VELOCITY)
    height = build.scalar(HEIGHT)
    k = curvatures(build, shape, P, height)
    along = sp.S.Zero
    if k.excess != 0:
        along = build.value(
            "along",
            k.excess * (v[0] * P[2, 0] + v[1] * P[2, 1]),
            "excess, times cos latitude and north velocity",
        )
    rate = [-k.transverse * (v[1] + along * P[2, 1]), k.transverse * (v[0] + along * P[2, 0]), sp.S.Zero]
    if azimuth == "free":
        rate[2] = -build.scalar(SIDEREAL_RATE) * P[2, 2]
    elif azimuth == "north":
        cosine = build.value(
            "cos_latitude", sp.Max(P[2, 1], sp.Rational(STEEPEST)), "cosine of latitude, limited"
        )
        rate[2] = build.value("tan_latitude", P[2, 2] / cosine) * k.transverse * v[0]
    build.output(TRANSPORT_RATE, rate)
    notes = [AZIMUTHS[azimuth][0].upper() + AZIMUTHS[azimuth][1:] + "."]
    if azimuth == "north":
        notes.append(f"Where the cosine of latitude is below {STEEPEST}, y of n does not stay north.")
    return build.kernel(
        f"{azimuth}-rate-{shape}",
        f"Transport rate over {'a sphere' if shape == 'sphere' else 'an ellipsoid'}, "
        + ("north-slaved" if azimuth == "north" else f"{azimuth} azimuth"),
        DERIVED,
        notes=tuple(notes),
    )


def navigation_turn(ahead: bool = False) -> Kernel:
    """Return the rate of the navigation frame times a cycle, (Wn + rho) T, which the trapezoidal rule (27) takes.

    A slow loop that holds this value over m of its cycles needs it ahead: extrapolated by `lead` navigation cycles,
    1/2 + 1/(2m), a rate that is linear in time is integrated exactly by the rule, which itself lags by half a slow
    cycle.
    """
    build = KernelBuilder()
    before = build.input(PREVIOUS_RATE) if ahead else None
    W, rho = build.input(EARTH_RATE), build.input(TRANSPORT_RATE)
    cycle = build.scalar(CYCLE)
    title = "Rate of the navigation frame against inertial axes, times the cycle"
    if before is None:
        build.output(TURN, cycle * (W + rho))
        return build.kernel("navigation-turn", title, DERIVED)
    lead = build.scalar(LEAD)
    rate = build.stage(replace(PREVIOUS_RATE, name="rate", elements=("w_x", "w_y", "w_z")), W + rho)
    build.output(TURN, cycle * (rate + lead * (rate - before)))
    build.output(after(PREVIOUS_RATE), rate)
    return build.kernel(
        "navigation-turn-ahead",
        f"{title}, extrapolated",
        DERIVED,
        recursion=Recursion(
            ((PREVIOUS_RATE.name, after(PREVIOUS_RATE).name),), retained=(PREVIOUS_RATE.name,)
        ),
    )
