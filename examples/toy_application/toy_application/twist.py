"""A study: how much of a coning motion is a rotation about z, in float beside double."""

import math
from dataclasses import dataclass
from typing import Annotated

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.cli.values import NotNegative
from strapgen.results.result import Result


@dataclass(frozen=True)
class Angle:
    """The angle about z of an attitude, from a back end."""

    backend: str
    angle_rad: float


@dataclass(frozen=True)
class TwistResult(Result):
    """How much of a coning motion is a rotation about z: a row for each back end."""

    row, rows_in = Angle, "angles"
    angles: list[Angle]


def angles(half_angle_deg: float, backends: tuple[str, ...]) -> list[Angle]:
    """Return the angle about z, of an attitude on a cone, from each back end."""
    import strapgen

    half = math.radians(half_angle_deg) / 2
    attitude = [math.sin(half), 0.0, 0.1 * math.cos(half), math.sqrt(0.99) * math.cos(half)]
    twists = ((name, strapgen.evaluator("twist-z", backend=name)(attitude)) for name in backends)
    return [Angle(name, 2 * math.atan2(*map(float, twist))) for name, twist in twists]


@grouped
def study_twist(
    half_angle: Annotated[NotNegative, option("--half-angle-deg", help="Half angle of the cone.")] = "5",
    *,
    output: Output,
) -> None:
    """Show the rotation about z of an attitude on a cone.

    Example: strapgen study twist --half-angle-deg 10
    """
    output.show(TwistResult(angles(float(half_angle), ("numpy", "c", "c-float"))))
