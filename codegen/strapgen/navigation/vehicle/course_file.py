"""A user's course over the earth: a start, and legs one after the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from strapgen.catalogue.toml_models import Key, UserFile, check_kind
from strapgen.ir.exceptions import InputError
from strapgen.navigation.vehicle.legs import Legs
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion
from strapgen.navigation.vehicle.vehicle_motions import over_earth

#: The keys of each kind of leg: those that it needs, and those that it may have.
KINDS = {
    "hold": (("duration_s",), ()),
    "accelerate": (("speed_m_s",), ("acceleration_m_s2",)),
    "turn": (("angle_deg",), ("bank_deg", "rate_deg_s")),
    "climb": (("height_m",), ("rate_m_s",)),
    "stop": ((), ("acceleration_m_s2",)),
}
#: What a turn banks by, and what a leg accelerates and climbs with, where it does not say so.
_BANK_DEG, _ACCELERATION, _CLIMB = 25.0, 1.0, 10.0


@dataclass(frozen=True)
class Start:
    """The start of a course."""

    latitude_deg: Annotated[float, Key("Latitude", "deg", least=-90, most=90)] = 45.0
    longitude_deg: Annotated[float, Key("Longitude", "deg", least=-180, most=360)] = 0.0
    height_m: Annotated[float, Key("Height above the ellipsoid", "m", least=-1000, most=60000)] = 0.0
    speed_m_s: Annotated[float, Key("Speed along the ground", "m/s", least=0, most=1000)] = 0.0
    heading_deg: Annotated[float, Key("Heading, clockwise from north", "deg", least=-360, most=360)] = 0.0


@dataclass(frozen=True)
class Leg:
    """A leg of a course."""

    kind: Annotated[str, Key("Kind of the leg", choices=tuple(KINDS))]
    duration_s: Annotated[float | None, Key("Duration of a hold", "s", above=0, most=1e6)] = None
    speed_m_s: Annotated[float | None, Key("Speed at its end", "m/s", least=0, most=1000)] = None
    acceleration_m_s2: Annotated[float | None, Key("Largest acceleration", "m/s^2", above=0, most=100)] = None
    angle_deg: Annotated[float | None, Key("Angle of a turn, clockwise", "deg", least=-3600, most=3600)] = (
        None
    )
    bank_deg: Annotated[float | None, Key("Bank of a turn", "deg", above=0, most=80)] = None
    rate_deg_s: Annotated[
        float | None, Key("Rate of a turn in place of a bank, on the ground", "deg/s", above=0, most=100)
    ] = None
    height_m: Annotated[float | None, Key("Height at its end", "m", least=-1000, most=60000)] = None
    rate_m_s: Annotated[float | None, Key("Largest climb rate", "m/s", above=0, most=1000)] = None

    def __post_init__(self) -> None:
        check_kind(self, "a leg", KINDS)
        if self.bank_deg is not None and self.rate_deg_s is not None:
            raise InputError("a turn has bank_deg and rate_deg_s; one of them is needed")


@dataclass(frozen=True)
class CourseFile:
    """A course of a vehicle over the earth."""

    leg: Annotated[tuple[Leg, ...], Key("The legs, one after the other", least=1, most=200)]
    start: Annotated[Start, Key("Place, speed and heading at the start")] = Start()
    title: Annotated[str, Key("Title in tables")] = ""

    def motion(self, name: str) -> VehicleMotion:
        """Return the motion."""
        start = self.start
        legs = Legs.begun(start.speed_m_s, math.radians(start.heading_deg))
        for number, leg in enumerate(self.leg, 1):
            begun = legs.time
            try:
                _go(legs, leg, start.height_m)
            except InputError as error:
                raise InputError(f"leg {number}: {error}") from None
            if legs.time == begun:
                raise InputError(f"leg {number}: this {leg.kind} changes nothing; leave it out")
        place = math.radians(start.latitude_deg), math.radians(start.longitude_deg)
        return over_earth(name, *place, start.height_m, legs.controls)


def _go(legs: Legs, leg: Leg, ground: float) -> None:
    """Add a leg."""
    if leg.duration_s is not None:
        legs.hold(leg.duration_s)
    elif leg.kind in ("accelerate", "stop"):
        legs.accelerate(leg.speed_m_s or 0.0, leg.acceleration_m_s2 or _ACCELERATION)
    elif leg.height_m is not None:
        legs.climb(leg.height_m - ground - legs.climbed, leg.rate_m_s or _CLIMB)
    elif leg.angle_deg is not None and leg.rate_deg_s is not None:
        legs.turn(math.radians(leg.angle_deg), math.radians(leg.rate_deg_s), banks=False)
    elif leg.angle_deg is not None:
        bank = math.radians(leg.bank_deg or _BANK_DEG)
        legs.turn(math.radians(leg.angle_deg), legs.bank_rate(bank))


COURSE = UserFile("a course", CourseFile, 1 << 16)


def read_course(path: Path) -> VehicleMotion:
    """Read a course."""
    return COURSE.convert(path, lambda course: course.motion(str(path)))
