"""The errors that a study of the loops of an attitude and heading reference disturbs them by."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from strapgen.ir.exceptions import InputError

#: What an error has to be smaller than; a larger heading error would be taken for that on the other side.
_LARGEST = {"heading_deg": 180.0}


@dataclass(frozen=True)
class LoopErrors:
    """Errors that disturb the loops of a study, each in a case of its own."""

    #: Earth rate and gyro bias, about a level axis and about down
    rate_deg_h: float = 10.0
    #: Errors of the attitude at the start
    tilt_deg: float = 0.5
    #: Error of the reference velocity
    velocity_m_s: float = 5.0
    heading_deg: float = 1.0
    #: Bias of the vertical accelerometer, in thousandths of g
    acceleration_mg: float = 1.0
    #: Reference height
    height_m: float = 10.0

    def __post_init__(self) -> None:
        for one in fields(self):
            value, largest = getattr(self, one.name), _LARGEST.get(one.name, 1e6)
            if not abs(value) < largest:
                raise InputError(f"{one.name} is {value:g}; a magnitude below {largest:g} is needed")

    def cases(self, loop: str, gravity: float) -> dict[str, tuple[dict[str, float], dict[str, float]]]:
        """Return the cases of a loop: constant inputs and states at the start, in SI units, by the name of the case."""
        rate = math.radians(self.rate_deg_h) / 3600
        if loop == "level":
            return {
                f"rate {self.rate_deg_h:g} deg/h": ({"drift": rate}, {}),
                f"tilt {self.tilt_deg:g} deg": ({}, {"phi": math.radians(self.tilt_deg)}),
                f"reference {self.velocity_m_s:g} m/s": ({"Vr": self.velocity_m_s}, {}),
            }
        if loop == "heading":
            return {
                f"rate {self.rate_deg_h:g} deg/h": ({"drift": rate}, {}),
                f"heading {self.heading_deg:g} deg": ({}, {"psi": math.radians(self.heading_deg)}),
            }
        return {
            f"bias {self.acceleration_mg:g} mg": ({"force": self.acceleration_mg * 1e-3 * gravity}, {}),
            f"reference {self.height_m:g} m": ({"hr": self.height_m}, {}),
        }
