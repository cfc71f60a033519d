"""The filters of examples/kalman as dense matrices of numpy: error equations by hand, van Loan's method, one gain.

Nothing here reads the files of the examples or comes from the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

Array = NDArray[np.float64]
OMEGA = 7.292115e-5
DEG_H = np.pi / 180 / 3600


def skew(v: Any) -> Array:
    """Return [v x]."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], float)


@dataclass
class Dense:
    """A filter x' = F x + B(u) + w, z = H x + v, as matrices."""

    states: list[str]
    inputs: list[str]
    interval: float
    F: Callable[[Mapping[str, float]], Array]
    S: Array
    H: Callable[[Mapping[str, float]], dict[str, Array]]
    R: Mapping[str, float]
    P0: Array
    forced: Mapping[str, str] = field(default_factory=dict)
    every: Mapping[str, int] = field(default_factory=dict)

    def discrete(self, values: Mapping[str, float]) -> tuple[Array, Array, Array]:
        """Return the transition, the change by the forcing inputs, and the noise of an interval (van Loan 1978)."""
        # Each state in units of its deviation at the start, so that the exponentials lose no small ones.
        n, scale = len(self.states), np.sqrt(np.diag(self.P0))
        F, S = self.F(values) * scale / scale[:, None], self.S / np.outer(scale, scale)
        wide = np.zeros((n + 1, n + 1))
        wide[:n, :n] = F
        for state, name in self.forced.items():
            wide[self.states.index(state), n] = values[name] / scale[self.states.index(state)]
        both = expm(wide * self.interval)
        loan = expm(np.block([[-F, S], [np.zeros((n, n)), F.T]]) * self.interval)
        Q = both[:n, :n] @ loan[:n, n:]
        Phi = both[:n, :n] * scale[:, None] / scale
        return Phi, both[:n, n] * scale, (Q + Q.T) / 2 * np.outer(scale, scale)

    def run(
        self, measurements: Mapping[str, Array], inputs: Mapping[str, Array], first: Array
    ) -> tuple[Array, Array]:
        """Return states (N + 1, n) and covariances of one run, all measurements of a step at once."""
        x, P = first.copy(), self.P0.copy()
        states, covariances = [x], [P]
        for k in range(1, len(next(iter(measurements.values()))) + 1):
            values = {name: float(value[k - 1]) for name, value in inputs.items()}
            Phi, forced, Q = self.discrete(values)
            x, P = Phi @ x + forced, Phi @ P @ Phi.T + Q
            names = [
                name
                for name, z in measurements.items()
                if k % self.every.get(name, 1) == 0 and np.isfinite(z[k - 1])
            ]
            if names:
                H = np.array([self.H(values)[name] for name in names])
                R = np.diag([self.R[name] ** 2 for name in names])
                K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
                x = x + K @ (np.array([measurements[name][k - 1] for name in names]) - H @ x)
                P = (np.eye(len(x)) - K @ H) @ P @ (np.eye(len(x)) - K @ H).T + K @ R @ K.T
            states.append(x)
            covariances.append(P)
        return np.array(states), np.array(covariances)

    def steady(self) -> tuple[Array, Array]:
        """Return the steady gain of one measurement and the covariance after it."""
        Phi, _, Q = self.discrete(dict.fromkeys(self.inputs, 0.0))
        ((name, row),) = self.H({}).items()
        H, R = row[None], np.array([[self.R[name] ** 2]])
        P = solve_discrete_are(Phi.T, H.T, Q, R)
        K = P @ H.T / (H @ P @ H.T + R)
        return K[:, 0], P - K @ H @ P


def in_earth_axes(biases: bool) -> Dense:
    """Return the filter of zero-velocity.toml, or with biases that of gnss.toml: Groves (2013), (14.49)."""
    n = 15 if biases else 9
    names = [
        f"{part}_{a}" for part in ("attitude", "velocity", "position", "gyro", "accelerometer") for a in "xyz"
    ]
    inputs = [f"force_{a}" for a in "xyz"]
    latitude, longitude = np.radians([47.5, 8.5])
    fixed = np.array(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    if biases:
        inputs += [f"up_{a}" for a in "xyz"] + [f"c_{a}{b}" for a in "xyz" for b in "xyz"]

    def F(u: Mapping[str, float]) -> Array:
        up = np.array([u[f"up_{a}"] for a in "xyz"]) if biases else fixed
        W, full = skew([0, 0, OMEGA]), np.zeros((15, 15))
        full[0:3, 0:3] = -W
        full[3:6, 0:3] = -skew([u[f"force_{a}"] for a in "xyz"])
        full[3:6, 3:6] = -2 * W
        full[3:6, 6:9] = 9.8 / 6378137 * (3 * np.outer(up, up) - np.eye(3))
        full[6:9, 3:6] = np.eye(3)
        if biases:
            C = np.array([[u[f"c_{a}{b}"] for b in "xyz"] for a in "xyz"])
            full[0:3, 9:12] = full[3:6, 12:15] = C
        return full[:n, :n]

    turn, push = 0.05 / 60 * np.pi / 180, (50e-6 if biases else 1e-4) * 9.80665
    S = np.diag([turn**2] * 3 + [push**2] * 3 + [0] * (n - 6))
    rows = {}
    for k, a in enumerate("xyz"):
        if biases:
            rows[f"receiver_position_{a}"], rows[f"receiver_velocity_{a}"] = (
                np.eye(n)[6 + k],
                np.eye(n)[3 + k],
            )
        else:
            rows[f"still_{a}"] = np.eye(n)[3 + k]
    R = {name: {"receiver_p": 2.0, "receiver_v": 0.05}.get(name[:10], 0.01) for name in rows}
    start = [2e-3, 0.1, 5, DEG_H, 500e-6 * 9.80665] if biases else [1e-3, 0.01, 1]
    P0, interval = np.diag(np.repeat(start, 3)) ** 2, 0.5 if biases else 1.0
    every = dict.fromkeys(rows, 2 if biases else 1)
    return Dense(names[:n], inputs, interval, F, S, lambda u: rows, R, P0, every=every)


def fine_alignment() -> Dense:
    """Return the filter of fine-alignment.toml: psi' = -W x psi + b, v' = psi x f - 2 W x v, axes north, east, down."""
    W = OMEGA * np.array([np.cos(np.pi / 4), 0, -np.sin(np.pi / 4)])
    F = np.zeros((7, 7))
    F[0:3, 0:3] = -skew(W)
    F[0:2, 5:7] = np.eye(2)
    F[3:5, 0:3] = -skew([0, 0, -9.8062])[:2]
    F[3:5, 3:5] = -2 * skew(W)[:2, :2]
    walk, push = 0.002 / 60 * np.pi / 180, 20e-6 * 9.80665
    rows = {"computed_north": np.eye(7)[3], "computed_east": np.eye(7)[4]}
    P0 = np.diag([2e-3, 2e-3, 0.0175, 0.01, 0.01, 0.01 * DEG_H, 0.01 * DEG_H]) ** 2
    names = [
        "tilt_north",
        "tilt_east",
        "azimuth",
        "velocity_north",
        "velocity_east",
        "gyro_north",
        "gyro_east",
    ]
    S = np.diag([walk**2] * 3 + [push**2] * 2 + [0, 0])
    return Dense(names, [], 1.0, lambda u: F, S, lambda u: rows, dict.fromkeys(rows, 0.01), P0)


def wind() -> Dense:
    """Return the filter of wind.toml."""
    names = ["velocity_north", "velocity_east", "wind_north", "wind_east"]

    def H(u: Mapping[str, float]) -> dict[str, Array]:
        north, east, per = u["station_north"], u["station_east"], u["per_distance"]
        return {
            "air_north": np.array([1.0, 0, -1, 0]),
            "air_east": np.array([0.0, 1, 0, -1]),
            "range_rate": np.array([-north, -east, 0, 0]),
            "radial_rate": per * np.array([east, -north, 0, 0]),
        }

    inputs = ["acceleration_north", "acceleration_east", "station_north", "station_east", "per_distance"]
    R = {"air_north": 1.5, "air_east": 1.5, "range_rate": 2.0, "radial_rate": 5e-4}
    forced = {"velocity_north": "acceleration_north", "velocity_east": "acceleration_east"}
    return Dense(
        names, inputs, 1.0, lambda u: np.zeros((4, 4)), np.diag([0.02, 0.02, 0.1, 0.1]) ** 2, H, R,
        np.diag([10.0, 10, 15, 15]) ** 2, forced, {"radial_rate": 10},
    )  # fmt: skip


def baro_inertial() -> Dense:
    """Return the filter of baro-inertial.toml."""
    F = np.array([[0, 1, 0], [2 * 9.80665 / 6378137, 0, -1], [0, 0, 0]])
    rows = {"barometer": np.eye(3)[0]}
    return Dense(
        ["height", "climb", "bias"], ["acceleration"], 0.25, lambda u: F, np.diag([0, 0.01, 2e-4]) ** 2,
        lambda u: rows, {"barometer": 3.0}, np.diag([5, 0.5, 0.01]) ** 2, {"climb": "acceleration"},
    )  # fmt: skip


FILTERS = {
    "fine-alignment": fine_alignment,
    "zero-velocity": lambda: in_earth_axes(False),
    "gnss": lambda: in_earth_axes(True),
    "wind": wind,
    "baro-inertial": baro_inertial,
}
