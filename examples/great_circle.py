"""A navigator on a great circle in inertial axes: the error of position falls with the square of the cycle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import strapgen

#: A sphere of 6400 km: its rate in rad/s, 1/radius in 1/m, gravitation and centrifugal acceleration in m/s^2.
RATE, RADIUS, MU = 7.292115e-5, 6.4e6, 3.986004418e14
EARTH = {
    "sidereal_rate": RATE,
    "curvature": 1 / RADIUS,
    "gravitation": MU / RADIUS**2,
    "centrifugal": RATE**2 * RADIUS,
}
#: Rate of the body about y in rad/s, specific force along z in m/s^2, latitude and longitude after an hour in deg.
TURN, FORCE, END = 1e-4, 9.667456098632812, (15.6558004725, -1.4398961885)


class Navigator:
    """Values by name, and kernels that take them by the names of their inputs."""

    def __init__(self, cycle: float, mode: str, state: np.ndarray, velocity: np.ndarray) -> None:
        self.rates = {"earth_rate": "earth-rate", "transport_rate": f"{mode}-rate-sphere"}
        self.rates |= {
            "gravity": "gravity-sphere",
            "acceleration": "coriolis-gravity",
            "turn": "navigation-turn",
        }
        self.kernels: dict[str, Callable[..., Any]] = {}
        self.values: dict[str, Any] = {
            **EARTH,
            "cycle": cycle,
            "height": 0.0,
            "state": state,
            "velocity": velocity,
        }
        self.values["position"] = strapgen.evaluator("position-from-angles")(np.zeros(3))
        self.find_rates()
        for name in ("acceleration", "transport_rate", "turn"):
            self.values[f"previous_{name}"] = self.values[name]

    def call(self, name: str, **others: Any) -> Any:
        """Return the outputs of a kernel on the values, some of them replaced."""
        kernel = self.kernels.setdefault(name, strapgen.evaluator(name))
        values = self.values | others
        return kernel(*(values[signal.name] for signal in kernel.function.inputs))  # type: ignore[attr-defined]

    def find_rates(self) -> None:
        """Evaluate all rates at the current state."""
        for result, name in self.rates.items():
            self.values[result] = self.call(name)

    def advance(self, rotation: np.ndarray, sensed: np.ndarray) -> None:
        """Advance by a cycle with the rotation vector of the body and the integral of the specific force."""
        sensed = self.call("dcm-acceleration", acceleration=sensed)
        turn = self.values["turn"]
        sensed = sensed + self.call(
            "navigation-velocity", navigation_rotation=turn, navigation_velocity=sensed
        )
        turned = self.call("dcm-update", rotation_vector=rotation)
        velocity, acceleration = self.call("velocity-step-level", velocity_change=sensed)
        position, transport = self.call("position-step")
        self.values |= {"velocity": velocity, "previous_acceleration": acceleration}
        self.values |= {"position": position, "previous_transport_rate": transport}
        self.find_rates()
        angle, self.values["previous_turn"] = self.call(
            "navigation-rotation", navigation_rotation=np.zeros(3)
        )
        self.values["state"] = self.call("dcm-navigation-update", state=turned, navigation_rotation=angle)


def error(cycle: float, mode: str) -> np.ndarray:
    """Return the error of latitude and longitude in deg after an hour; the cycle is in s."""
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))
    start = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    navigator = Navigator(cycle, mode, start, np.array([640 * c - RATE * RADIUS, 640 * s, 0]))
    angle = TURN * cycle
    integral = FORCE / TURN * np.array([1 - np.cos(angle), 0, np.sin(angle)])
    for _ in range(round(3600 / cycle)):
        navigator.advance(np.array([0, angle, 0]), integral)
    angles = strapgen.evaluator("geographic-angles")(navigator.values["position"], np.zeros(3))
    return np.asarray(np.degrees(angles[:2]) - END)


def main() -> None:
    """Print the errors for two modes of the frame and two cycles."""
    for mode in ("wander", "free"):
        for cycle in (24.0, 12.0):
            print(f"{mode:6} {cycle:4} s: error in deg", " ".join(f"{x:9.2e}" for x in error(cycle, mode)))


if __name__ == "__main__":
    main()
