"""A study: how much of a coning motion is a rotation about z, in float beside double."""

from typing import Annotated

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import option
from strapgen.cli.output import Output
from strapgen.ir.exceptions import InputError
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable


def angles(half_angle_deg: float, backends: tuple[str, ...]) -> list[tuple[str, float]]:
    """Return the angle about z in rad, of an attitude on a cone, from each back end."""
    import math

    import numpy as np

    import strapgen

    half = math.radians(half_angle_deg) / 2
    attitude = np.array([math.sin(half), 0.0, 0.1 * math.cos(half), math.sqrt(0.99) * math.cos(half)])
    twists = ((name, strapgen.evaluator("twist-z", backend=name)(attitude)) for name in backends)
    return [(name, 2 * math.atan2(*map(float, twist))) for name, twist in twists]


@grouped
def study_twist(
    half_angle: Annotated[float, option("--half-angle-deg", help="Half angle of the cone in deg.")] = 5.0,
    *,
    output: Output,
) -> None:
    """Show the rotation about z of an attitude on a cone.

    Example: strapgen study twist --half-angle-deg 10
    """
    if not 0 <= half_angle < 180:
        raise InputError(f"half_angle_deg is {half_angle:g}; 0 to 180 are allowed")
    rows = angles(half_angle, ("numpy", "c", "c-float"))
    table = TextTable([Column("back end", "<"), Column("angle_rad", spec=".15g")], rows)
    data = [{"backend": name, "angle_rad": angle} for name, angle in rows]
    output.report(Report(table.as_text, lambda: data, lambda: table))
