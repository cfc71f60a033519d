"""The earth as a turning sphere or a level ellipsoid: the constants that the kernels of the navigation frame take."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from strapgen.ir.exceptions import InputError


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


def schuler_rate(gravity: float, radius: float) -> float:
    """Return Schuler's frequency sqrt(g/R) in rad/s.

    `gravity`: in m/s^2.

    >>> f"{schuler_rate(9.81, 6373388):.10e}"
    '1.2406501275e-03'
    """
    return math.sqrt(gravity / radius)
