"""The signals of the navigation frame n, whose z axis points up, and of the earth-fixed frame e."""

from __future__ import annotations

from fractions import Fraction

from strapgen.ir.signals import Signal

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
