"""Derives the rate of the navigation frame: earth rate, transport rate, and the rotation of the frame in a cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen.catalogue.kernels.two_speed_kernels import TURN
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
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
    build.feedback(PREVIOUS_RATE, rate)
    return build.kernel(
        "navigation-turn-ahead",
        f"{title}, extrapolated",
        DERIVED,
    )


FENNER = (
    "P. J. Fenner, Requirements, Applications, and Results of Strapdown Inertial Technology to Commercial Airplanes, "
    "AGARD Lecture Series 133 (1984)"
)
#: The source of these kernels: the paper describes the navigation frame in words, and prints no equation.
DERIVED = f"derived from the words of {FENNER}"

POSITION = Signal.matrix(
    "position",
    "P",
    meaning="position C_n^e, direction cosine matrix from navigation axes n to earth-fixed axes e",
    bound=Fraction(1),
    constraint="rotation",
    frame="n to e",
)
VELOCITY = Signal.vector(
    "velocity",
    "v",
    unit="m/s",
    meaning="velocity relative to the earth, navigation axes n",
    bound=Fraction(1000),
    frame="n",
)
HEIGHT = Signal.scalar(
    "height", unit="m", meaning="height above the sphere or ellipsoid, along z of n", bound=Fraction(60000)
)
SIDEREAL_RATE = Signal.scalar(
    "sidereal_rate",
    unit="rad/s",
    meaning="earth rate about z of e, against inertial axes i",
    bound=Fraction(1, 8200),
)
EARTH_RATE = Signal.vector(
    "earth_rate",
    "W",
    unit="rad/s",
    meaning="rate of the earth e against inertial axes i, navigation axes n",
    bound=Fraction(1, 8200),
    frame="n",
)
TRANSPORT_RATE = Signal.vector(
    "transport_rate",
    "rho",
    unit="rad/s",
    meaning="rate of the navigation frame n against the earth e, navigation axes n",
    bound=Fraction(1, 4200),
    frame="n",
)
CURVATURE = Signal.scalar(
    "curvature",
    unit="1/m",
    meaning="1 over the (equatorial) radius of the earth",
    bound=Fraction(1, 6_000_000),
)
ECCENTRICITY = Signal.scalar(
    "eccentricity_squared",
    unit="1",
    meaning="e^2 of the meridian's ellipse, no frame",
    bound=Fraction(1, 100),
)
GRAVITY = Signal.vector(
    "gravity",
    "g",
    unit="m/s^2",
    meaning="plumb-bob gravity, gravitation with the centrifugal acceleration, navigation axes n",
    bound=Fraction(12),
    frame="n",
)
ACCELERATION = Signal.vector(
    "acceleration",
    "a",
    unit="m/s^2",
    meaning="gravity and Coriolis acceleration at the start of the cycle, navigation axes n",
    bound=Fraction(12),
    frame="n",
)
GEOGRAPHIC = Signal(
    "geographic",
    (3,),
    ("latitude", "longitude", "wander"),
    unit="rad",
    meaning="latitude, longitude and wander angle, from east to x of n, positive about up; axes n against e",
    bound=Fraction(355, 113),
    frame="n to e",
)


@dataclass(frozen=True)
class Earth:
    """A model of the earth, and its constants by the names of the kernels' inputs.

    >>> Earth.sphere(3.986004418e14, 6.4e6, 7.292115e-5).constants["curvature"]
    1.5625e-07
    """

    #: "sphere" or "ellipsoid", as in the names of the kernels
    shape: str
    #: Radius of the sphere, or equatorial radius, in m
    radius: float
    #: Earth rate against inertial axes, in rad/s
    rate: float
    #: Value of every input of the kernels that is a constant of the earth, in SI units
    constants: Mapping[str, float]

    @classmethod
    def sphere(cls, mu: float, radius: float, rate: float) -> Earth:
        """Return a turning sphere.

        `mu`: gravitational constant times mass, in m^3/s^2. `rate`: in rad/s.
        """
        for name, value in (("mu", mu), ("radius", radius)):
            if not value > 0:
                raise InputError(f"{name} is {value}; a number above 0 is needed")
        constants = {
            "sidereal_rate": rate,
            "curvature": 1 / radius,
            "gravitation": mu / radius**2,
            "centrifugal": rate**2 * radius,
        }
        return cls("sphere", radius, rate, constants)

    @classmethod
    def wgs84(cls) -> Earth:
        """Return the ellipsoid of the World Geodetic System 1984, NIMA TR8350.2, tables 3.1 to 3.4.

        >>> round(1 / Earth.wgs84().constants["curvature"])
        6378137
        """
        radius, flattening, rate, mu = 6378137.0, 1 / 298.257223563, 7.292115e-5, 3.986004418e14
        polar = radius * (1 - flattening)
        constants = {
            "sidereal_rate": rate,
            "curvature": 1 / radius,
            "eccentricity_squared": flattening * (2 - flattening),
            "equator_gravity": 9.7803253359,
            "gravity_increase": 0.00193185265241,
            "flattening": flattening,
            "centrifugal_ratio": rate**2 * radius**2 * polar / mu,
        }
        return cls("ellipsoid", radius, rate, constants)

    def transverse_radius(self, sine: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return R_N in m at some sines of latitude."""
        square = self.constants.get("eccentricity_squared", 0.0)
        return np.asarray(self.radius / np.sqrt(1 - square * sine**2))

    def meridian_radius(self, sine: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return R_M in m at some sines of latitude."""
        square = self.constants.get("eccentricity_squared", 0.0)
        return np.asarray(self.transverse_radius(sine) * (1 - square) / (1 - square * sine**2))


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
