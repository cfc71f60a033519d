"""A reference navigator in inertial axes, which shares no code with the package: SciPy's eighth-order integration.

Position and velocity are integrated in inertial axes i, where there is no transport rate, no Coriolis acceleration and
no wander angle; the attitude is a closed form. The sphere turns about z and attracts with mu/r^2.

`predicted_errors` says what a navigator of second order is off by, from the series of its local errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

MU, RADIUS, RATE = 3.986004418e14, 6.4e6, 7.292115e-5
HEIGHT = 8000.0


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product of two vectors, quicker than numpy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class TestProfile:
    """An aircraft that turns at random along its way, while its body turns at random with up to 70 deg/s.

    The specific force follows from a law of guidance, so that the flight stays near a height: gravity taken off, turns
    across the velocity, climbs, and a weak pull back. Euler angles of the body are sums of sines.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.frequencies = rng.uniform(0.2, 1.0, (3, 3))
        self.phases = rng.uniform(0, 2 * np.pi, (3, 3))
        amplitudes = rng.uniform(0.5, 1, (3, 3)) / self.frequencies
        self.amplitudes = amplitudes * 0.33
        self.turns = rng.uniform(0.02, 0.08, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))

    def attitude(self, times: np.ndarray) -> Rotation:
        """Return the rotations from body to inertial axes."""
        angles = self.amplitudes * np.sin(self.frequencies * times[:, None, None] + self.phases)
        return Rotation.from_euler("ZYX", angles.sum(axis=-1))

    def specific_force(self, t: float, r: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the specific force in inertial axes in m/s^2."""
        distance = np.sqrt(r @ r)
        up = r / distance
        climb = v @ up
        across = cross(up, v)
        lateral, vertical = np.sin(self.turns[0] * t + self.turns[1]).sum(axis=1)
        level = (v @ v - climb**2) / distance + 1e-4 * (distance - RADIUS - HEIGHT) + 2e-2 * climb
        push = MU / distance**2 - level + 0.5 * vertical
        return push * up + 4.0 * lateral * across / np.sqrt(across @ across)

    def derivative(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return dy/dt of position, velocity and the integral of specific force in inertial axes."""
        r, v = y[:3], y[3:6]
        f = self.specific_force(t, r, v)
        return np.concatenate([v, f - MU * r / (r @ r) ** 1.5, f])

    def flown(self, times: np.ndarray) -> np.ndarray:
        """Return the states at the times, the first of them the start: at 0.6 rad of latitude, 220 m/s to the east."""
        r = (RADIUS + HEIGHT) * np.array([np.cos(0.6), 0, np.sin(0.6)])
        v = np.array([0, 220.0, 0]) + RATE * np.array([-r[1], r[0], 0])
        start = np.concatenate([r, v, np.zeros(3)])
        settings = {"rtol": 1e-13, "atol": np.repeat([1e-7, 1e-11, 1e-11], 3), "max_step": 1.0}
        solution = solve_ivp(self.derivative, times[[0, -1]], start, "DOP853", times, **settings)
        assert solution.success
        return solution.y.T


@dataclass(frozen=True)
class Shown:
    """What navigators are compared in: axes to east, north and up at the computed position.

    Parameters
    ----------
    latitude, longitude, height, velocity, attitude : array
        rad, rad, m, m/s (..., 3), rotation matrices (..., 3, 3) from body or inertial axes.
    """

    latitude: np.ndarray
    longitude: np.ndarray
    height: np.ndarray
    velocity: np.ndarray
    attitude: np.ndarray

    def less(self, other: Shown) -> np.ndarray:
        """Return the differences in m to north, east and up, m/s, and rad about east, north and up."""
        turned = self.attitude @ np.swapaxes(other.attitude, -1, -2)
        about = np.stack([turned[..., 2, 1], turned[..., 0, 2], turned[..., 1, 0]], -1)
        back = np.stack([turned[..., 1, 2], turned[..., 2, 0], turned[..., 0, 1]], -1)
        place = [
            RADIUS * (self.latitude - other.latitude),
            RADIUS * np.cos(other.latitude) * (self.longitude - other.longitude),
            self.height - other.height,
        ]
        return np.concatenate(
            [np.stack(place, -1), self.velocity - other.velocity, (about - back) / 2], axis=-1
        )


def local_axes(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Return rotation matrices from earth-fixed axes to east, north and up."""
    sl, cl, so, co = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    zero = np.zeros_like(sl)
    rows = [[-so, co, zero], [-sl * co, -sl * so, cl], [cl * co, cl * so, sl]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def shown_of_reference(times: np.ndarray, flown: np.ndarray, attitude: np.ndarray) -> Shown:
    """Return what a flight in inertial axes is over the earth; `attitude` (..., 3, 3) is to inertial axes."""
    r, v = flown[:, :3], flown[:, 3:6]
    distance = np.linalg.norm(r, axis=1)
    latitude = np.arctan2(r[:, 2], np.hypot(r[:, 0], r[:, 1]))
    inertial = np.arctan2(r[:, 1], r[:, 0])
    longitude = np.mod(inertial - RATE * times + np.pi, 2 * np.pi) - np.pi
    axes = local_axes(latitude, inertial)
    relative = v - RATE * np.stack([-r[:, 1], r[:, 0], 0 * times], -1)
    velocity = (axes @ relative[..., None])[..., 0]
    return Shown(latitude, longitude, distance - RADIUS, velocity, axes @ attitude)


def shown_of_frame(
    position: np.ndarray, velocity: np.ndarray, height: np.ndarray, attitude: np.ndarray
) -> Shown:
    """Return the same of C_n^e, velocity in axes n, height, and the attitude to axes n."""
    up = position[..., 2]
    latitude = np.arctan2(up[..., 2], np.hypot(up[..., 0], up[..., 1]))
    longitude = np.arctan2(up[..., 1], up[..., 0])
    turn = local_axes(latitude, longitude) @ position
    return Shown(latitude, longitude, height, (turn @ velocity[..., None])[..., 0], turn @ attitude)


class Frame:
    """The equations of the navigation frame n in ordinary numpy, driven by the specific force in inertial axes.

    A state is (C_i^n, C_n^e, v, h) in a vector of 22 numbers, the sources of error beside it.
    """

    def __init__(self, free: bool) -> None:
        self.free = free

    def terms(self, y: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the rate of the frame, the transport rate, gravity with Coriolis, and specific force in axes n."""
        C, P, v, h = y[:9].reshape(3, 3), y[9:18].reshape(3, 3), y[18:21], y[21]
        r = RADIUS + h
        W = RATE * P[2]
        rho = np.array([-v[1] / r, v[0] / r, -W[2] if self.free else 0.0])
        radius = np.array([0, 0, r])
        g = np.array([0, 0, -MU / r**2]) - cross(W, cross(W, radius))
        return W + rho, rho, g - cross(2 * W + rho, v), C @ f

    def derivative(self, y: np.ndarray, f: np.ndarray, source: np.ndarray) -> np.ndarray:
        """Return dy/dt; `source` adds to the rate of the frame, the transport rate, the acceleration and v_z."""
        rate, rho, a, force = self.terms(y, f)
        C, P = y[:9].reshape(3, 3), y[9:18].reshape(3, 3)
        turned = -np.array([cross(rate + source[:3], column) for column in C.T]).T
        moved = -np.array([cross(rho + source[3:6], row) for row in P])
        climb = [y[20] + source[9]]
        return np.concatenate([turned.ravel(), moved.ravel(), force + a + source[6:9], climb])

    def run(
        self, start: np.ndarray, forces: np.ndarray, step: float, sources: np.ndarray | None = None
    ) -> np.ndarray:
        """Integrate by the classical fourth-order method; forces and sources are given at every half step."""
        if sources is None:
            sources = np.zeros((len(forces), 10))
        states = [start]
        for k in range(0, len(forces) - 2, 2):
            y = states[-1]
            k1 = self.derivative(y, forces[k], sources[k])
            k2 = self.derivative(y + step / 2 * k1, forces[k + 1], sources[k + 1])
            k3 = self.derivative(y + step / 2 * k2, forces[k + 1], sources[k + 1])
            k4 = self.derivative(y + step * k3, forces[k + 2], sources[k + 2])
            states.append(y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        return np.array(states)


def frame_of(states: np.ndarray) -> Shown:
    """Return what states of `Frame` show, the attitude of inertial axes."""
    matrices = states[:, :18].reshape(-1, 2, 3, 3)
    return shown_of_frame(matrices[:, 1], states[:, 18:21], states[:, 21], matrices[:, 0])


def predicted_errors(
    flight: TestProfile, seconds: int, cycle: float, free: bool
) -> tuple[np.ndarray, Frame, np.ndarray]:
    """Return the errors after every second of a navigator with cycles of `cycle` seconds, to second order in them.

    Each rule has a local error whose leading term, over the cycle, acts as a source in the equations of the frame.
    With T the cycle, dots derivatives, and f the specific force in axes n: extrapolation to mid-cycle,
    T (3 a_k - a_(k-1))/2, is less than the integral by 5/12 T^3 a''; the trapezoidal rule is more by T^3/12 W''; and
    -T^2 W_k x f/2 for the turning frame, with its rate at the start of the cycle, leaves
    T^3 (W x f'/12 + W' x f/6 - W x (W x f)/12). At the start, where a_(-1) is taken as a_0, T^2 a'/2 is missing.

    Returns
    -------
    array, (seconds + 1, 9)
        As `Shown.less`.
    """
    times = np.arange(2 * seconds + 1) / 2
    flown = flight.flown(times)
    forces = np.array([flight.specific_force(t, y[:3], y[3:6]) for t, y in zip(times, flown, strict=True)])
    frame, start = Frame(free), frame_start(flown[0])
    plain = frame.run(start, forces, 1.0)
    terms = [np.array(t) for t in zip(*map(frame.terms, plain, forces[::2]), strict=True)]
    (rate, rho, a, f), vertical = (make_spline(t) for t in terms), make_spline(plain[:, 20])

    def at(spline, order):
        return spline(times, order)

    square = cycle**2
    turning = (np.cross(at(rate, 0), at(f, 1)) + 2 * np.cross(at(rate, 1), at(f, 0))) / 12
    turning -= np.cross(at(rate, 0), np.cross(at(rate, 0), at(f, 0))) / 12
    sources = square * np.concatenate(
        [
            at(rate, 2) / 12,
            -5 / 12 * at(rho, 2),
            -5 / 12 * at(a, 2) + turning,
            at(vertical, 2)[:, None] / 12,
        ],
        axis=1,
    )
    late = start.copy()
    late[18:21] -= square / 2 * a(0.0, 1)
    P = start[9:18].reshape(3, 3)
    late[9:18] -= square / 2 * -np.array([cross(rho(0.0, 1), row) for row in P]).ravel()
    return frame_of(frame.run(late, forces, 1.0, sources)).less(frame_of(plain)), plain


def make_spline(values: np.ndarray):
    """Return a spline of the fifth degree through values of every second."""
    return make_interp_spline(np.arange(len(values), dtype=float), values, 5)


def frame_start(y: np.ndarray) -> np.ndarray:
    """Return the state of the frame where x begins east and y north, at the time 0."""
    r = y[:3]
    axes = local_axes(np.arctan2(r[2], np.hypot(r[0], r[1])), np.arctan2(r[1], r[0]))
    velocity = axes @ (y[3:6] - RATE * np.array([-r[1], r[0], 0]))
    return np.concatenate([axes.ravel(), axes.T.ravel(), velocity, [np.sqrt(r @ r) - RADIUS]])
