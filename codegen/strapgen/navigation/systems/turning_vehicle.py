"""A vehicle that turns on one spot of the earth while it vibrates: exact attitude, and the counts of its sensors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.navigation.frame.frame_rates import Earth

Array = NDArray[np.float64]

#: Axes east, north, up of those of north, east, down.
_EAST_NORTH_UP = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
#: Everything repeats after so many seconds, so that the increments of hours are those of this time.
_PERIOD = 120
#: Cycles whose increments are computed together.
_BLOCK = 1 << 14
#: Lines that stand for a spectrum, spread evenly in the logarithm of frequency.
_LINES = 24


@dataclass(frozen=True)
class _Waves:
    """A sum of sines of one channel, with its first derivative."""

    amplitudes: Array
    frequencies: Array
    phases: Array

    def value(self, time: Array, derivative: int = 0) -> Array:
        """Return the sum at some times, or its derivative."""
        total = np.zeros_like(time)
        for a, w, phase in zip(self.amplitudes, self.frequencies, self.phases, strict=True):
            total += a * w**derivative * np.sin(w * time + phase + derivative * math.pi / 2)
        return total


class TurningVehicle:
    """A vehicle whose heading swings with turns of a stated rate, in roll and pitch, and which vibrates.

    `latitude`: in rad. `turn_rate`: largest rate of heading in rad/s.

    >>> vehicle = TurningVehicle(0.8, 1.2)
    >>> vehicle.attitude(np.zeros(1)).round(6)[0, 2]
    array([ 0.,  0., -1.])
    """

    def __init__(
        self, latitude: float, turn_rate: float, spectrum: Spectrum | None = None, seed: int = 1984
    ) -> None:
        self.earth = Earth.wgs84()
        self.earth_rate = self.earth.rate * np.array([0, math.cos(latitude), math.sin(latitude)])
        sine = math.sin(latitude) ** 2
        constants = self.earth.constants
        self.gravity = (
            constants["equator_gravity"]
            * (1 + constants["gravity_increase"] * sine)
            / math.sqrt(1 - constants["eccentricity_squared"] * sine)
        )
        swing, roll, pitch = (math.tau * turns / _PERIOD for turns in (10, 8, 6))
        self._turn = _Waves(np.array([turn_rate / swing]), np.array([swing]), np.zeros(1))
        self._roll = _Waves(np.array([0.3]), np.array([roll]), np.zeros(1))
        self._pitch = _Waves(np.array([0.15]), np.array([pitch]), np.zeros(1))
        self._vibration = dict(_lines(spectrum, seed)) if spectrum else {}
        highest = max((w.frequencies.max() for w in self._vibration.values()), default=1.0)
        self.highest_hz = float(highest) / math.tau

    def _channel(self, name: str, time: Array, derivative: int = 0) -> Array:
        waves = self._vibration.get(name)
        return np.zeros_like(time) if waves is None else waves.value(time, derivative)

    def _angles(self, time: Array, derivative: int = 0) -> tuple[Array, Array, Array]:
        """Return roll, pitch and heading, or their rates."""
        return (
            self._roll.value(time, derivative) + self._channel("angle_x", time, derivative),
            self._pitch.value(time, derivative) + self._channel("angle_y", time, derivative),
            self._turn.value(time, derivative),
        )

    def attitude(self, time: Array) -> Array:
        """Return C_b^n at some times, (..., 3, 3); axes n are east, north, up."""
        return self._attitude([(np.sin(a), np.cos(a)) for a in self._angles(np.asarray(time, float))])

    @staticmethod
    def _attitude(angles: Sequence[tuple[Array, Array]]) -> Array:
        """Return C_b^n from the sines and cosines of roll, pitch and heading."""
        (sr, cr), (sp, cp), (sh, ch) = angles
        rows = [
            [cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh],
            [cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch],
            [-sp, sr * cp, cr * cp],
        ]
        matrix = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
        return np.asarray(_EAST_NORTH_UP @ matrix)

    def measured(self, time: Array) -> tuple[Array, Array]:
        """Return body rate in rad/s and specific force in m/s^2 at some times, body axes, (..., 3)."""
        angles = [(np.sin(a), np.cos(a)) for a in self._angles(time)]
        roll_rate, pitch_rate, turn_rate = self._angles(time, 1)
        (sr, cr), (sp, cp), _ = angles
        rate = np.stack(
            [
                roll_rate - turn_rate * sp,
                pitch_rate * cr + turn_rate * sr * cp,
                -pitch_rate * sr + turn_rate * cr * cp,
            ],
            axis=-1,
        )
        attitude = self._attitude(angles)
        force = attitude[..., 2, :] * self.gravity
        zero = np.zeros_like(time)
        shaken = [self._channel(f"velocity_{axis}", time, 1) for axis in "xy"]
        return rate + self.earth_rate @ attitude, force + np.stack([*shaken, zero], axis=-1)

    def increments(self, step: float, count: int) -> tuple[Array, Array]:
        """Return angle increments in rad and velocity increments in m/s of cycles from time 0, (count, 3) each.

        Gauss's rule integrates each cycle, with enough nodes for the highest frequency of the vibration.
        """
        once = round(_PERIOD / step)
        if count > once and math.isclose(once * step, _PERIOD, rel_tol=1e-12):
            angle, velocity = (np.tile(part, (-(-count // once), 1)) for part in self.increments(step, once))
            return angle[:count], velocity[:count]
        nodes, weights = np.polynomial.legendre.leggauss(6 + math.ceil(5 * self.highest_hz * step))
        blocks = list(self._blocks(step, count, (1 + nodes) / 2, weights * step / 2))
        return np.concatenate([a for a, _ in blocks]), np.concatenate([v for _, v in blocks])

    def _blocks(self, step: float, count: int, nodes: Array, weights: Array) -> Iterator[tuple[Array, Array]]:
        for first in range(0, count, _BLOCK):
            begin = np.arange(first, min(first + _BLOCK, count)) * step
            rate, force = self.measured(begin[:, None] + step * nodes)
            yield np.einsum("cnk,n->ck", rate, weights), np.einsum("cnk,n->ck", force, weights)


def _lines(spectrum: Spectrum, seed: int) -> Iterator[tuple[str, _Waves]]:
    """Return sines with the power of a spectrum, by channel; those of one frequency keep their phases to each other."""
    edges = np.geomspace(spectrum.edges[0], spectrum.edges[-1], _LINES + 1)
    middle = np.rint(np.sqrt(edges[:-1] * edges[1:]) * _PERIOD) / _PERIOD
    size = np.sqrt(2 * spectrum.densities(middle) * np.diff(edges))
    random = np.random.default_rng(seed).uniform(0, math.tau, _LINES)
    for name, transfer in spectrum.amplitudes(middle).items():
        yield name, _Waves(size * np.abs(transfer), math.tau * middle, random + np.angle(transfer))
