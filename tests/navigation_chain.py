"""A navigator in numpy of nothing but generated kernels, which tests run beside closed forms and other integrations."""

from __future__ import annotations

from functools import cache

import numpy as np

import strapgen
from strapgen.navigation.frame.frame_rates import Earth


@cache
def kernel(name: str):
    """Return the generated function of a kernel, and the names of its inputs."""
    evaluator = strapgen.evaluator(name)
    return evaluator.generated, tuple(signal.name for signal in evaluator.function.inputs)


class Navigator:
    """The chain of kernels at one rate: position, velocity and attitude over cycles of `cycle` seconds.

    A cycle has the rotation vector of the body and the integral of the specific force in body axes at its start, which
    any strapdown algorithm delivers. The state is in `values`, under the names of the kernels' inputs; arrays of runs
    are allowed.
    """

    def __init__(self, earth: Earth, cycle: float, azimuth: str = "wander", level: bool = False) -> None:
        self.transport = f"{azimuth}-rate-{earth.shape}"
        self.gravity = f"gravity-{earth.shape}"
        self.level = level
        self.values = {
            name: np.asarray(value) for name, value in (earth.constants | {"cycle": cycle}).items()
        }

    def __getitem__(self, name: str) -> np.ndarray:
        return self.values[name]

    def call(self, name: str, **renamed):
        """Call a kernel with the state's values, or with others under the name of the input."""
        function, inputs = kernel(name)
        return function(*(renamed[i] if i in renamed else self.values[i] for i in inputs))

    def begin(self, attitude, geographic, velocity, height=0.0) -> None:
        """Start with C_b^n, latitude, longitude and wander angle in rad, and the velocity in axes n in m/s."""
        self.values |= {
            name: np.asarray(value, float)
            for name, value in (("state", attitude), ("geographic", geographic), ("velocity", velocity))
        }
        self.values["height"] = np.asarray(height, float)
        self.values["position"] = self.call("position-from-angles")
        self.values["previous"] = self.values["geographic"]
        self.find_rates()
        for rate in ("acceleration", "transport_rate"):
            self.values[f"previous_{rate}"] = self.values[rate]
        self.values["previous_turn"] = self.values["turn"]

    def find_rates(self) -> None:
        """Compute everything that follows from the state."""
        for name, signal in (
            ("earth-rate", "earth_rate"),
            (self.transport, "transport_rate"),
            (self.gravity, "gravity"),
            ("coriolis-gravity", "acceleration"),
            ("navigation-turn", "turn"),
        ):
            self.values[signal] = self.call(name)

    def run_cycle(self, rotation_vector, integral) -> None:
        """Go on by a cycle: rotation vector in rad, integral of the specific force in body axes at its start, m/s."""
        values = self.values
        change = self.call("dcm-acceleration", acceleration=integral)
        correction = self.call(
            "navigation-velocity", navigation_rotation=values["turn"], navigation_velocity=change
        )
        state = self.call("dcm-update", rotation_vector=rotation_vector)
        step = "velocity-step-level" if self.level else "velocity-step"
        velocity, past = self.call(step, velocity_change=change + correction)
        position, before = self.call("position-step")
        if not self.level:
            values["height"] = self.call("height-step", next_velocity=velocity)
        values |= {
            "velocity": velocity,
            "previous_acceleration": past,
            "position": position,
            "previous_transport_rate": before,
        }
        self.find_rates()
        rotation, values["previous_turn"] = self.call("navigation-rotation", navigation_rotation=np.zeros(3))
        values["state"] = self.call("dcm-navigation-update", state=state, navigation_rotation=rotation)

    def shown(self) -> dict[str, np.ndarray]:
        """Return latitude, longitude, wander angle and heading in degrees, and the velocity to north, east and down."""
        self.values["previous"] = self.values["geographic"] = self.call("geographic-angles")
        attitude = self.call("dcm-north-east-down")
        angles = kernel("euler-angles-from-dcm")[0](attitude, np.zeros(3))
        return {
            "geographic": np.degrees(self["geographic"]),
            "heading": np.degrees(angles[..., 2]),
            "ground_velocity": self.call("ground-velocity"),
        }
