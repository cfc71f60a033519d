"""The motions over the earth by name, and the files that hold others, as plain data."""

from __future__ import annotations

import math

from strapgen.lab.motions.motion_names import MotionEntry

_PLACE = {"latitude": "rad", "longitude": "rad", "height": "m", "heading": "rad"}
_SPEED = {**_PLACE, "speed": "m/s"}
_START = {"latitude": math.radians(45), "longitude": 0.0, "height": 0.0, "heading": math.radians(45)}
_FLIGHT = {**_START, "speed": 250.0}
_MOTIONS = f"{__package__}.vehicle_motions"
_BANK = math.radians(25)

#: Motions over the earth.
TABLE = {
    "great-circle": MotionEntry(_SPEED, f"{_MOTIONS}:great_circle", _FLIGHT, True),
    "polar": MotionEntry(
        _SPEED, f"{_MOTIONS}:polar", {**_FLIGHT, "latitude": math.radians(89.5), "heading": 0.0}, True
    ),
    "turn": MotionEntry({**_SPEED, "bank": "rad"}, f"{_MOTIONS}:turn", {**_FLIGHT, "bank": _BANK}, True),
    "climb": MotionEntry(
        {**_SPEED, "climb": "m/s", "top": "m"},
        f"{_MOTIONS}:climb",
        {**_FLIGHT, "climb": 10.0, "top": 2000.0},
        True,
    ),
    "taxi": MotionEntry(_SPEED, f"{_MOTIONS}:taxi", {**_START, "heading": 0.0, "speed": 8.0}, True),
    "s-turns": MotionEntry(
        {**_SPEED, "bank": "rad", "swing": "rad"},
        f"{_MOTIONS}:s_turns",
        {**_FLIGHT, "bank": _BANK, "swing": math.radians(60)},
        True,
    ),
    "swinging": MotionEntry(
        {**_PLACE, "turn_rate": "rad/s"},
        f"{_MOTIONS}:swinging",
        {"latitude": math.radians(45), "longitude": 0.0, "height": 0.0, "heading": 0.0}
        | {"turn_rate": math.radians(70)},
        True,
    ),
}

#: The readers of files with motions over the earth, by the endings of their names.
FILES = {
    ".toml": f"{__package__}.course_file:read_course",
    ".csv": f"{__package__}.recorded_track:read_track",
}
