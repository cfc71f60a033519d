"""Outputs of a navigator that relate to its track: drift, flight path, accelerations, rate of turn, and the wind.

The source (Table 13) names them with range and accuracy, and prints no formula: all are derived from their definitions.
"""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import FENNER
from strapgen.navigation.outputs import GROUND_VELOCITY, HEADING

#: Ground speed in m/s below which path and track say too little: 20 knots.
SLOWEST = Fraction(1852 * 20, 3600)
_TURN, _QUARTER = Fraction(355, 113), Fraction(355, 226)
_SOURCE = f"{FENNER}, Table 13 names the output; derived from its definition"
_TRACK = Signal.scalar(
    "track_angle", unit="rad", meaning="direction of the ground velocity, from north over east", bound=_TURN
)
_PATH = Signal.scalar(
    "flight_path_angle",
    unit="rad",
    meaning="angle of the velocity above the horizontal plane",
    bound=_QUARTER,
)
_SPEED = Signal.scalar(
    "ground_speed",
    unit="m/s",
    meaning="horizontal velocity relative to the earth",
    bound=Fraction(2108),
)
#: 4 g, the range of the output.
_ACCELERATION = Signal(
    "acceleration",
    (3,),
    ("north_acceleration", "east_acceleration", "down_acceleration"),
    unit="m/s^2",
    meaning="derivative of the velocity relative to the earth, axes to north, east and down",
    bound=Fraction(40),
    frame="g",
)
_AIRSPEED = Signal.scalar(
    "true_airspeed", unit="m/s", meaning="speed relative to the air, along the heading", bound=Fraction(1000)
)
_ACROSS = Signal.scalar(
    "cross_track_acceleration",
    unit="m/s^2",
    meaning="horizontal acceleration to the right of the track",
    bound=Fraction(40),
)


def drift_angle() -> Kernel:
    """Return the track angle less the heading, without whole turns: positive for a drift to the right."""
    build = KernelBuilder()
    track, heading = build.scalar(_TRACK), build.scalar(HEADING)
    output = Signal.scalar("drift_angle", unit="rad", meaning="track angle less true heading")
    build.output(output, [Wrapped(track - heading)])
    return build.kernel(
        "drift-angle", "Drift angle", _SOURCE, notes=("Angles are told without whole turns.",)
    )


def flight_path_angle() -> Kernel:
    """Return the angle of the velocity above the horizontal plane."""
    build = KernelBuilder()
    north, east, down = build.input(GROUND_VELOCITY)
    output = Signal.scalar("flight_path_angle", unit="rad", meaning=_PATH.meaning)
    speed = build.value("speed", sp.sqrt(north**2 + east**2), "ground speed in m/s")
    limited = build.value(
        "limited_speed", sp.Max(speed, sp.Rational(SLOWEST)), "ground speed in m/s, limited"
    )
    build.output(output, [sp.atan2(-down, limited)])
    return build.kernel(
        "flight-path-angle",
        "Flight-path angle",
        _SOURCE,
        notes=("Below 20 knots of ground speed the angle is that at 20 knots.",),
    )


def track_accelerations() -> Kernel:
    """Return the accelerations along and across the track, upwards, and along the flight path."""
    build = KernelBuilder()
    north, east, down = build.input(_ACCELERATION)
    track, path = build.scalar(_TRACK), build.scalar(_PATH)
    sine = build.value("sine", sp.sin(track), "sine of the track angle")
    cosine = build.value("cosine", sp.cos(track), "cosine of the track angle")
    along = build.value("along", north * cosine + east * sine, "horizontal acceleration along the track")
    for name, meaning, value in (
        ("along_track_acceleration", "horizontal acceleration along the track", along),
        (_ACROSS.name, _ACROSS.meaning, east * cosine - north * sine),
        ("vertical_acceleration", "acceleration upwards", -down),
        (
            "flight_path_acceleration",
            "acceleration along the velocity",
            along * sp.cos(path) - down * sp.sin(path),
        ),
    ):
        build.output(Signal.scalar(name, unit="m/s^2", meaning=meaning), [value])
    return build.kernel("track-accelerations", "Accelerations along and across the track", _SOURCE)


def track_angle_rate() -> Kernel:
    """Return the rate of the track angle: the acceleration across the track over the ground speed."""
    build = KernelBuilder()
    across, speed = build.scalar(_ACROSS), build.scalar(_SPEED)
    limited = build.value(
        "limited_speed", sp.Max(speed, sp.Rational(SLOWEST)), "ground speed in m/s, limited"
    )
    output = Signal.scalar("track_angle_rate", unit="rad/s", meaning="rate of the track angle")
    build.output(output, [across / limited])
    return build.kernel(
        "track-angle-rate",
        "Rate of the track angle",
        _SOURCE,
        notes=("Below 20 knots of ground speed the rate is that at 20 knots.",),
    )


def wind() -> Kernel:
    """Return the wind: the ground velocity less that through the air, as speed and as the direction it comes from."""
    build = KernelBuilder()
    north, east, _ = build.input(GROUND_VELOCITY)
    airspeed, heading = build.scalar(_AIRSPEED), build.scalar(HEADING)
    to_north = build.value("to_north", north - airspeed * sp.cos(heading), "wind to the north in m/s")
    to_east = build.value("to_east", east - airspeed * sp.sin(heading), "wind to the east in m/s")
    build.output(
        Signal.scalar("wind_speed", unit="m/s", meaning="speed of the air over the ground"),
        [sp.sqrt(to_north**2 + to_east**2)],
    )
    build.output(
        Signal.scalar(
            "wind_direction", unit="rad", meaning="where the wind comes from, from north over east"
        ),
        [sp.atan2(-to_east, -to_north)],
    )
    return build.kernel(
        "wind",
        "Wind of ground velocity and true airspeed",
        _SOURCE,
        notes=("The air is taken to move along the heading: no sideslip.",),
    )
