"""The motions by name, as plain data: their parameters, and the functions that make them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from strapgen import catalogue, registration
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.registry import Registry

_PROFILES = f"{__package__}.rate_profiles"


class MotionEntry(NamedTuple):
    """A motion of the table."""

    #: Its parameters and the unit of each: "rad/s", "rad", "s", "Hz", "m" or "m/s"
    parameters: Mapping[str, str]
    #: "module:function": takes the parameters in SI units by name, and returns the `RateProfile` of the motion,
    #: or the motion itself. "" for a motion in closed form, which the kernels NAME-truth and NAME-increments
    #: compute
    function: str = ""
    #: Parameters in SI units that can be left out as long as another one is set
    defaults: Mapping[str, float] = {}
    #: Whether all of them can be left out
    complete: bool = False

    @property
    def title(self) -> str:
        """Its parameters with their units."""
        return ", ".join(f"{name} in {unit}" for name, unit in self.parameters.items())


#: The motions of strapgen: those in closed form, then those that only runs know.
TABLE = {
    **{
        name: MotionEntry(
            units, defaults=dict.fromkeys(units, 0.0) if name in ("constant", "polynomial") else {}
        )
        for name, units in catalogue.MOTIONS.items()
    },
    "cone": MotionEntry(
        {"half_angle": "rad", "frequency": "Hz", "spin": "rad/s"},
        f"{__package__}.motions:cone",
        {"spin": 0.0},
    ),
    "random": MotionEntry({"rate": "rad/s"}, f"{_PROFILES}:random_rate"),
    "slew": MotionEntry({"onset": "s", "rate": "rad/s"}, f"{_PROFILES}:slew", {"rate": math.radians(300)}),
    "ramps": MotionEntry({"onset": "s", "rate": "rad/s"}, f"{_PROFILES}:ramps", {"rate": math.radians(300)}),
    "vibration": MotionEntry(
        {"angle": "rad", "gyro": "Hz"}, f"{_PROFILES}:vibration_rate", {"gyro": math.inf}
    ),
}


#: Motions that runs can have, by name.
MOTIONS = Registry("motions", MotionEntry)


def is_file(name: str) -> bool:
    """Return whether the name of a motion is that of a file."""
    return name.endswith((".py", *file_readers()))


def file_readers() -> dict[str, str]:
    """Return the functions that read the motions of other applications' files, by the ending of a file's name."""
    return {
        ending: place
        for readers in registration.extensions("lab.motion-files")
        for ending, place in readers.items()
    }


def parameters(
    what: str,
    known: Mapping[str, Mapping[str, float]],
    settings: Mapping[str, Any],
    defaults: Mapping[str, float],
) -> dict[str, float]:
    """Return the parameters that settings state, in SI units; `known` has the factor of every key that sets one.

    >>> parameters("motion turn", {"z": {"z_deg_s": 0.5, "z_rad_s": 1.0}}, {"z_deg_s": "3"}, {})
    {'z': 1.5}
    """
    allowed = [key for choices in known.values() for key in choices]
    for key in settings:
        checks.choice(f"key of {what}:", key, allowed)
    if not settings:
        raise InputError(f"{what} needs parameters; allowed: {', '.join(allowed)}")
    values: dict[str, float] = {}
    for parameter, choices in known.items():
        used = [key for key in choices if key in settings]
        if len(used) > 1:
            raise InputError(f"{what}: {' and '.join(used)} are both given; one is needed")
        if not used and parameter not in defaults:
            raise InputError(f"{what} lacks {' or '.join(choices)}")
        values[parameter] = defaults.get(parameter, 0.0)
        for key in used:
            values[parameter] = float(checks.number(key, settings[key])) * choices[key]
    return values
