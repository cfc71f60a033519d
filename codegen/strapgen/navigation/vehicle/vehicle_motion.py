"""The motion of a vehicle over the ellipsoid: exact attitude and velocity, integrated position, sensed increments.

All is computed in wander-azimuth axes n, which have no pole: attitude and velocity are closed forms of the `Controls`,
and the position C_n^e follows by collocation at Gauss's nodes, at which it is as exact as doubles are.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.lab.motions.motions import Motion
from strapgen.navigation.frame.frame_rates import Earth
from strapgen.navigation.vehicle.controls import Controls
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]

#: Axes east, north, up of those of north, east, down.
_EAST_NORTH_UP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
#: Length of a piece of the position's polynomial in s, at most, and its nodes.
_PIECE, _NODES = 16.0, 12
#: Most passes of the fixed-point iteration of a piece; each gains the angle that is covered, 1e-4 or less.
_PASSES = 8
#: Cycles whose increments are computed together.
_BLOCK = 1 << 13
#: Gauss nodes of a cycle, and further ones for a second of it and for a radian of its highest frequency.
_CYCLE_NODES, _SECOND_NODES, _WAVE_NODES = 6, 4.0, 0.8


def _chebyshev() -> tuple[Array, Array, Array]:
    """Return nodes on [0, 1], the matrix of integrals from 0 to each, and barycentric weights."""
    nodes = (1 - np.cos(np.pi * np.arange(_NODES) / (_NODES - 1))) / 2
    vandermonde = np.polynomial.chebyshev.chebvander(2 * nodes - 1, _NODES - 1)
    integrals = np.array(
        [
            np.polynomial.chebyshev.chebval(2 * nodes - 1, np.polynomial.chebyshev.chebint(row, lbnd=-1)) / 2
            for row in np.eye(_NODES)
        ]
    ).T
    weights = np.where(np.arange(_NODES) % 2, -1.0, 1.0)
    weights[[0, -1]] /= 2
    return nodes, np.asarray(integrals @ np.linalg.inv(vandermonde)), weights


_PLACES, _INTEGRALS, _WEIGHTS = _chebyshev()


@dataclass(frozen=True)
class Sensed:
    """What is measured at some times in body axes, (..., 3) each."""

    #: Rate against inertial axes in rad/s
    rate: Array
    #: Specific force in m/s^2
    force: Array


@dataclass(frozen=True, eq=False)
class VehicleMotion(Motion):
    """A motion over the WGS-84 ellipsoid, with specific force, velocity and position.

    Velocity, position and `navigation_attitude` are in wander-azimuth axes n, x to the east and y to the north at the
    start, and z up. `attitude` is that against inertial axes, of the body at the start.
    """

    controls: Controls = field(default_factory=Controls)
    #: Latitude and longitude in rad, and height in m, at the start
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: Time in s after which all repeats, 0 for never
    period: float = 0.0

    @cached_property
    def earth(self) -> Earth:
        """The ellipsoid."""
        return Earth.wgs84()

    def attitude(self, time: Any) -> Array:
        """Return the attitude against inertial axes, see `Motion.attitude`."""
        times = np.asarray(time, float)
        turned = self.earth.rate * times
        c, s, o = np.cos(turned), np.sin(turned), np.zeros_like(times)
        earth = np.stack([c, -s, o, s, c, o, o, o, o + 1], axis=-1).reshape(*times.shape, 3, 3)
        result: Array = self._first.T @ earth @ self.position(times) @ self.navigation_attitude(times)
        return result

    @cached_property
    def _first(self) -> Array:
        return np.asarray(self._begin @ self.navigation_attitude(0.0))

    def navigation_attitude(self, time: Any) -> Array:
        """Return C_b^n at some times, (..., 3, 3)."""
        return self._attitude(self.controls.angles(np.asarray(time, float))[0])

    @staticmethod
    def _attitude(angles: tuple[Array, Array, Array]) -> Array:
        """Return C_b^n of roll, pitch and heading."""
        return np.asarray(_EAST_NORTH_UP @ evaluator("dcm-from-euler-angles")(np.stack(angles, axis=-1)))

    def velocity(self, time: Any) -> Array:
        """Return the velocity relative to the earth in m/s, axes n, (..., 3)."""
        times = np.asarray(time, float)
        steady = self.controls.velocity(times)[0]
        if not self.controls.waves:
            return steady
        shaken = self.controls.shaking(times)[0]
        return np.asarray(steady + np.einsum("...ij,...j->...i", self.navigation_attitude(times), shaken))

    def height(self, time: Any) -> Array:
        """Return the height above the ellipsoid in m."""
        return np.asarray(self.start[2] + self.controls.height_gain(np.asarray(time, float)))

    def rate(self, time: Any) -> Array:
        """Return the body rate against inertial axes, see `Motion.rate`."""
        return self.sensed(time).rate

    def sensed(self, time: Any) -> Sensed:
        """Return rate and specific force at some times."""
        times = np.asarray(time, float)
        angles, rates = self.controls.angles(times)
        (sr, cr), (sp, cp) = ((np.sin(angle), np.cos(angle)) for angle in angles[:2])
        attitude = self._attitude(angles)
        roll_rate, pitch_rate, turn_rate = rates
        in_body = np.stack(
            [
                roll_rate - turn_rate * sp,
                pitch_rate * cr + turn_rate * sr * cp,
                -pitch_rate * sr + turn_rate * cr * cp,
            ],
            axis=-1,
        )
        velocity, change = self.controls.velocity(times)
        position = self.position(times)
        frame, acceleration = self._frame(position, velocity, self.height(times))
        force = np.einsum("...ji,...j->...i", attitude, change - acceleration)
        if self.controls.waves:
            shaken, shaking = self.controls.shaking(times)
            force = force + shaking + np.cross(in_body, shaken)
        return Sensed(in_body + np.einsum("...ji,...j->...i", attitude, frame), force)

    def _frame(self, position: Array, velocity: Array, height: Array) -> tuple[Array, Array]:
        """Return the rate of axes n against inertial ones, and gravity less the Coriolis acceleration."""
        earth, transport = self._call("earth-rate", position), self._transport(position, velocity, height)
        gravity = self._call("gravity-ellipsoid", position, height)
        acceleration = evaluator("coriolis-gravity")(velocity, gravity, earth, transport)
        return earth + transport, np.asarray(acceleration)

    def frame_rates(self, time: Any) -> tuple[Array, Array]:
        """Return the earth rate and the transport rate in axes n at some times, rad/s, (..., 3) each."""
        times = np.asarray(time, float)
        position = self.position(times)
        velocity = self.controls.velocity(times)[0]
        return self._call("earth-rate", position), self._transport(position, velocity, self.height(times))

    def mean_radius(self, time: Any) -> Array:
        """Return the radius of the earth at some times, that of Gauss, and the height, in m."""
        sine = self.position(time)[..., 2, 2]
        radius = np.sqrt(self.earth.transverse_radius(sine) * self.earth.meridian_radius(sine))
        return np.asarray(radius + self.height(time))

    def _transport(self, position: Array, velocity: Array, height: Array) -> Array:
        return self._call("wander-rate-ellipsoid", position, velocity, height)

    def _call(self, kernel: str, *values: Array) -> Array:
        """Return a kernel's output on values and constants of the earth."""
        function, constants = self._kernels[kernel]
        return np.asarray(function(*values, *constants))

    @cached_property
    def _kernels(self) -> dict[str, tuple[Any, list[float]]]:
        """The kernels of the frame and of gravity, each with the constants of the earth that it takes."""
        kernels = {
            name: evaluator(name) for name in ("earth-rate", "wander-rate-ellipsoid", "gravity-ellipsoid")
        }
        known = self.earth.constants
        return {
            name: (kernel, [known[i.name] for i in kernel.function.inputs if i.name in known])
            for name, kernel in kernels.items()
        }

    # The position

    def position(self, time: Any) -> Array:
        """Return the position C_n^e at some times, (..., 3, 3)."""
        times = np.asarray(time, float)
        if self.controls.stands:
            return np.asarray(np.broadcast_to(self._begin, (*times.shape, 3, 3)))
        flat = times.ravel()
        result = np.empty((len(flat), 9))
        for sign in (1.0, -1.0):  # after the start and before it
            side = flat >= 0 if sign > 0 else flat < 0
            if side.any():
                result[side] = self._interpolated(sign, np.abs(flat[side]))
        return result.reshape(*times.shape, 3, 3)

    def _interpolated(self, sign: float, ages: Array) -> Array:
        """Return the positions at ages from the start on to one side, (N, 9)."""
        self._extend(sign, float(ages.max()))
        pieces = self._pieces[sign]
        ends = np.array(pieces.ends)
        place = np.minimum(np.searchsorted(ends, ages, side="right"), len(ends) - 1)
        starts = np.concatenate([[0.0], ends[:-1]])[place]
        off = ((ages - starts) / (ends[place] - starts))[:, None] - _PLACES
        exact = np.abs(off) < 1e-14
        weights = _WEIGHTS / np.where(exact, 1.0, off)
        weights = np.where(exact.any(axis=1, keepdims=True), exact, weights)
        weights /= weights.sum(axis=1, keepdims=True)
        nodes, result = np.array(pieces.nodes), np.zeros((len(ages), 9))
        for node in range(_NODES):
            result += weights[:, node, None] * nodes[place, node]
        return result

    def cartesian(self, up: Array, height: Array) -> Array:
        """Return places in axes e in m, (..., 3), of their normals to the ellipsoid and heights."""
        square = self.earth.constants["eccentricity_squared"]
        transverse = self.earth.transverse_radius(up[..., 2])
        scale = np.stack([transverse, transverse, transverse * (1 - square)], axis=-1)
        return np.asarray((scale + height[..., None]) * up)

    @cached_property
    def _begin(self) -> Array:
        latitude, longitude, _ = self.start
        return np.asarray(evaluator("position-from-angles")([latitude, longitude, 0.0]))

    @cached_property
    def _pieces(self) -> dict[float, _Pieces]:
        return {1.0: _Pieces(), -1.0: _Pieces()}

    def _extend(self, sign: float, last: float) -> None:
        """Integrate the position up to an age: P' = P [rho x], by collocation at the nodes of each piece."""
        pieces, edges = self._pieces[sign], self.controls.edges if sign > 0 else []
        stop = self.controls.end
        while not pieces.ends or (pieces.ends[-1] <= last and pieces.ends[-1] < stop):
            begin = pieces.ends[-1] if pieces.ends else 0.0
            state = pieces.nodes[-1][-1].reshape(3, 3) if pieces.ends else self._begin
            following = bisect_right(edges, begin + 1e-9)
            end = min(begin + _PIECE, stop)
            if following < len(edges):
                end = min(end, edges[following])
            times = sign * (begin + (end - begin) * _PLACES)
            velocity, height = self.controls.velocity(times)[0], self.height(times)
            positions = np.broadcast_to(state, (_NODES, 3, 3))
            for _ in range(_PASSES):
                rho = self._transport(positions, velocity, height)
                slopes = np.cross(positions, rho[:, None, :])  # P [rho x]: each row of P, times rho
                moved = state + sign * (end - begin) * np.einsum("kn,nij->kij", _INTEGRALS, slopes)
                change = np.abs(moved - positions).max()
                positions = moved
                if change < 1e-17:
                    break
            u, _, v = np.linalg.svd(positions[-1])
            positions[-1] = u @ v
            pieces.ends.append(end)
            pieces.nodes.append(positions.reshape(_NODES, 9))

    # The sensors

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return exact angle increments, see `Motion.samples`."""
        return self.both_samples(interval, first, stop)[0]

    def both_samples(self, interval: Fraction, first: int, stop: int) -> tuple[Array, Array]:
        """Return angle increments in rad and velocity increments in m/s, body axes, (stop - first, 3) each.

        Gauss's rule integrates each cycle in parts that end at the edges of the controls, with enough nodes for the
        highest frequency of a vibration.
        """
        for (
            cycle,
            begin,
            end,
        ), held in self._sampled.items():  # runs on other sensors ask for the same again
            if cycle == interval and begin <= first <= stop <= end:
                return held[0][first - begin : stop - begin], held[1][first - begin : stop - begin]
        self._sampled.clear()
        self._sampled[interval, first, stop] = both = self._both_samples(interval, first, stop)
        return both

    @cached_property
    def _sampled(self) -> dict[tuple[Fraction, int, int], tuple[Array, Array]]:
        return {}

    def _both_samples(self, interval: Fraction, first: int, stop: int) -> tuple[Array, Array]:
        step = float(interval)
        if self.period and first == 0:
            once = round(self.period / step)
            if stop > once and math.isclose(once * step, self.period, rel_tol=1e-12):
                angle, velocity = (
                    np.tile(part, (-(-stop // once), 1)) for part in self.both_samples(interval, 0, once)
                )
                return angle[:stop], velocity[:stop]
        count = _CYCLE_NODES + math.ceil((_SECOND_NODES + _WAVE_NODES * self.controls.highest) * step)
        nodes, weights = np.polynomial.legendre.leggauss(count)
        nodes, weights = (1 + nodes) / 2, weights / 2
        blocks = list(self._blocks(step, first, stop, nodes, weights * step))
        if not blocks:
            return np.zeros((0, 3)), np.zeros((0, 3))
        angle, velocity = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        for cycle in {math.floor(edge / step) for edge in self.controls.edges} & {*range(first, stop)}:
            begin, end = cycle * step, (cycle + 1) * step
            inner = [edge for edge in self.controls.edges if begin < edge < end]
            bounds = np.array([begin, *inner, end])
            lengths = np.diff(bounds)[:, None]
            sensed = self.sensed(bounds[:-1, None] + lengths * nodes)
            angle[cycle - first] = np.einsum("pnk,pn->k", sensed.rate, lengths * weights)
            velocity[cycle - first] = np.einsum("pnk,pn->k", sensed.force, lengths * weights)
        return angle, velocity

    def _blocks(
        self, step: float, first: int, stop: int, nodes: Array, weights: Array
    ) -> Iterator[tuple[Array, Array]]:
        for begin in range(first, stop, _BLOCK):
            starts = np.arange(begin, min(begin + _BLOCK, stop)) * step
            times = starts[:, None] + step * nodes
            sensed = self.sensed(times)
            yield (
                np.einsum("cnk,n->ck", sensed.rate, weights),
                np.einsum("cnk,n->ck", sensed.force, weights),
            )


@dataclass
class _Pieces:
    """The polynomials of a position: the end of each in s, and its values at the nodes, (nodes, 9)."""

    ends: list[float] = field(default_factory=list)
    nodes: list[Array] = field(default_factory=list)
