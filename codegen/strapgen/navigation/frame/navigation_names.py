"""The names of the kernels of the navigation frame, as plain data."""

from __future__ import annotations

from typing import Any

from strapgen.ir.kernel_info import Recipe

_SHAPES = {"sphere": "a sphere", "ellipsoid": "an ellipsoid"}
_AZIMUTHS = {"wander": "wander azimuth", "free": "free azimuth", "north": "north-slaved"}


def _recipe(title: str, module: str, function: str, *arguments: Any) -> Recipe:
    """Return the recipe of a kernel of this folder."""
    return Recipe(title, f"strapgen.navigation.frame.{module}", function, arguments, standard=False)


#: Kernels of the navigation frame: its rate, gravity, velocity and position, and its alignment; they take no method.
NAVIGATION = {
    "earth-rate": _recipe("earth rate in navigation axes", "frame_rates", "earth_rate"),
    **{
        f"{azimuth}-rate-{shape}": _recipe(
            f"transport rate over {body}, {words}", "frame_rates", "transport_rate", shape, azimuth
        )
        for shape, body in _SHAPES.items()
        for azimuth, words in _AZIMUTHS.items()
    },
    "navigation-turn": _recipe(
        "rate of the navigation frame times the cycle", "frame_rates", "navigation_turn"
    ),
    "navigation-turn-ahead": _recipe(
        "rate of the navigation frame, extrapolated", "frame_rates", "navigation_turn", True
    ),
    "gravity-sphere": _recipe("gravity of a turning sphere", "gravity", "gravity_sphere"),
    "gravity-ellipsoid": _recipe("normal gravity of an ellipsoid", "gravity", "gravity_ellipsoid"),
    "coriolis-gravity": _recipe("gravity and Coriolis acceleration", "navigation_steps", "coriolis_gravity"),
    "velocity-step": _recipe("velocity after a cycle", "navigation_steps", "velocity_step"),
    "velocity-step-level": _recipe(
        "velocity after a cycle, vertical held", "navigation_steps", "velocity_step", True
    ),
    "position-step": _recipe("position after a cycle", "navigation_steps", "position_step"),
    "height-step": _recipe("height after a cycle", "navigation_steps", "height_step"),
    **{
        f"{name}-translation": _recipe(
            "velocity and position after a step", "translation_step", "translation", name
        )
        for name in ("dcm", "euler")
    },
    "geographic-angles": _recipe("latitude, longitude and wander angle", "geographic", "geographic_angles"),
    "position-from-angles": _recipe(
        "position of latitude, longitude, wander angle", "geographic", "position_from_angles"
    ),
    "dcm-north-east-down": _recipe("attitude against north, east, down", "geographic", "north_east_down"),
    "dcm-navigation-axes": _recipe("attitude against navigation axes", "geographic", "north_east_down", True),
    "ground-velocity": _recipe("velocity to north, east and down", "geographic", "ground_velocity"),
    "coarse-leveling": _recipe("coarse alignment: roll and pitch", "alignment", "coarse_leveling"),
    "coarse-azimuth": _recipe("coarse alignment: analytic gyrocompass", "alignment", "coarse_azimuth"),
    "late-latitude": _recipe("attitude for a latitude entered late", "alignment", "late_latitude"),
}
