"""Specific forces along a motion in body axes: exact velocity increments, and the resulting velocity and position.

A force has no need of a closed form: what has none is summed up at Gauss-Legendre nodes, so many that rounding is all
that is left. Gravity is in none of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.motions.motion_names import parameters as settings_of
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.rate_profiles import CosineSum, random_sum

Array = NDArray[np.float64]

_AXES = dict.fromkeys("xyz", "m/s^2")
#: Specific forces, and the unit of each of their parameters.
FORCES: dict[str, dict[str, str]] = {
    "constant": _AXES,
    "random": {"rms": "m/s^2", **_AXES},
    "oscillation": {
        **{f"swing_{axis}": "m/s^2" for axis in "xyz"},
        "frequency": "Hz",
        "phase": "rad",
        **_AXES,
    },
    "lever": dict.fromkeys("xyz", "m"),
}
#: Endings of the keys of a parameter by its unit, and the factor of each to SI units.
_ENDINGS = {
    "m/s^2": {"m_s2": 1.0, "g": STANDARD_GRAVITY},
    "Hz": {"hz": 1.0},
    "rad": {"deg": math.radians(1), "rad": 1.0},
    "m": {"m": 1.0},
}
#: Parameters without which a force makes no sense.
_NEEDED = {"random": ("rms",), "oscillation": ("frequency",)}
#: Numbers whose roots set the frequencies and phases of a random force, on the axes x, y and z.
_FREQUENCY_ROOTS, _PHASE_ROOTS = (17, 19, 23), (29, 31, 37)
#: Gauss-Legendre nodes of a piece, and its greatest length in s: at 50/3 Hz the rule is exact to 1e-17 of the force.
_NODES, _PIECE = 10, 0.01
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(_NODES)
_PLACES, _WEIGHTS = (1 + _PLACES) / 2, _WEIGHTS / 2
#: Pieces that are summed up together: some megabytes of attitudes.
_TOGETHER = 1 << 11

#: Cycles whose velocity increments are computed together, and nodes of Gauss's rule in each.
_CYCLES, _CYCLE_NODES = 1 << 14, 4


@dataclass(frozen=True)
class SpecificForce:
    """A specific force along a motion."""

    #: A key of `FORCES`
    name: str
    #: Its parameters in SI units
    parameters: dict[str, float]

    def velocity_increments(self, motion: Motion, interval: Fraction, first: int, stop: int) -> Array:
        """Return exact velocity increments of some sampling intervals.

        `interval`: sampling interval in s. Returns (stop - first, 3): integrals of the specific force in m/s, body
        axes.
        """
        edges = np.arange(first, stop + 1, dtype=np.float64) * float(interval)
        if self.name == "lever":
            return self._on_lever(motion, edges)
        increments: Array = np.diff(self._waves.angle(edges), axis=0) + self._steady * float(interval)
        return increments

    def translation(self, motion: Motion, interval: Fraction, count: int) -> tuple[Array, Array]:
        """Return the true velocity and position in reference axes, from rest at the place of the start.

        `interval`: time from one instant to the next in s. Returns (count + 1, 3): in m/s and m, from the instant 0
        on.
        """
        if self.name == "lever":
            times = np.arange(count + 1, dtype=np.float64) * float(interval)
            return self._of_lever(motion, times)
        parts = math.ceil(float(interval) / _PIECE)
        length = float(interval) / parts
        velocity, position = np.zeros((count * parts + 1, 3)), np.zeros((count * parts + 1, 3))
        for first in range(0, count * parts, _TOGETHER):
            starts = np.arange(first, min(first + _TOGETHER, count * parts))
            nodes = (starts[:, None] + _PLACES) * length
            turned = np.einsum("knij,knj->kni", motion.attitude(nodes), self._force(nodes))
            velocity[starts + 1] = np.einsum("kni,n->ki", turned, _WEIGHTS) * length
            position[starts + 1] = np.einsum("kni,n->ki", turned, _WEIGHTS * (1 - _PLACES)) * length**2
        velocity = velocity.cumsum(axis=0)
        position[1:] += velocity[:-1] * length
        return velocity[::parts], position.cumsum(axis=0)[::parts]

    @property
    def _steady(self) -> Array:
        return np.array([self.parameters.get(axis, 0.0) for axis in "xyz"])

    @property
    def _waves(self) -> CosineSum:
        """The part of the force that changes."""
        if self.name == "random":
            return random_sum(self.parameters["rms"], _FREQUENCY_ROOTS, _PHASE_ROOTS)
        swing = np.array([[self.parameters.get(f"swing_{axis}", 0.0)] for axis in "xyz"])
        turning = 2 * math.pi * self.parameters.get("frequency", 1.0)
        return CosineSum(swing, np.full((3, 1), turning), np.full((3, 1), self.parameters.get("phase", 0.0)))

    def _force(self, times: Array) -> Array:
        force: Array = self._waves.rate(times) + self._steady
        return force

    def _on_lever(self, motion: Motion, edges: Array) -> Array:
        """Return the increments on an arm l: of C* d(C (w x l))/dt, in parts w x l and the integral of w x (w x l)."""
        arm = self._steady
        parts = math.ceil(float(edges[1] - edges[0]) / _PIECE) if len(edges) > 1 else 1
        length = (edges[1] - edges[0]) / parts if len(edges) > 1 else 0.0
        total = np.diff(np.cross(motion.rate(edges), arm), axis=0)
        for part in range(parts):
            rates = motion.rate(edges[:-1, None] + (part + _PLACES) * length)
            total += np.einsum("kni,n->ki", np.cross(rates, np.cross(rates, arm)), _WEIGHTS) * length
        result: Array = total
        return result

    def _of_lever(self, motion: Motion, times: Array) -> tuple[Array, Array]:
        """Return velocity and position of the end of an arm, less those of the start."""
        arm, matrices = self._steady, motion.attitude(times)
        velocity = np.einsum("kij,kj->ki", matrices, np.cross(motion.rate(times), arm))
        position = matrices @ arm
        return velocity - velocity[0], position - position[0] - np.outer(times, velocity[0])


def keys(name: str) -> dict[str, dict[str, float]]:
    """Return, for every parameter of a force, the keys that set it and the factor of each to SI units.

    >>> list(keys("lever")["x"]), list(keys("random")["rms"])
    (['x_m'], ['rms_m_s2', 'rms_g'])
    """
    parameters = FORCES[checks.choice("force", name, FORCES)]
    return {
        parameter: {f"{parameter}_{ending}": factor for ending, factor in _ENDINGS[unit].items()}
        for parameter, unit in parameters.items()
    }


def force(name: str, /, **settings: Any) -> SpecificForce:
    """Return a specific force in body axes.

    `name`: "constant" (keys x, y, z), "random" (rms on each axis, up to 50/3 Hz, and x, y, z on top),
    "oscillation" (swing_x, swing_y, swing_z, frequency, phase of the cosine, and x, y, z on top) or "lever" (x,
    y, z: the arm from a point at rest to the sensors), whose keys end with a unit, as in ``x_m_s2``, ``x_g`` or
    ``x_m``.

    >>> force("oscillation", swing_y_g=1, frequency_hz=5).parameters["swing_y"]
    9.80665
    """
    known = keys(name)
    defaults = {parameter: 0.0 for parameter in known if parameter not in _NEEDED.get(name, ())}
    parameters = settings_of(f"force {name}", known, settings, defaults)
    if parameters.get("frequency", 1.0) <= 0:
        raise InputError(f"frequency_hz is {parameters['frequency']:g}; a number above 0 is needed")
    return SpecificForce(name, parameters)


def velocity_increments(
    attitude: Callable[[Array], Any], force: Iterable[float], interval: Fraction, count: int
) -> Array:
    """Return the velocity increments of a specific force that is constant in reference axes.

    `attitude`: returns direction cosine matrices, body to reference, at some times in s. `force`: in m/s^2,
    reference axes. `interval`: length of a cycle in s. Returns (count, 3): in m/s, body axes; Gauss's rule
    integrates each cycle.
    """
    vector, step = np.array([*force], float), float(interval)
    if not vector.any():
        return np.zeros((count, 3))
    nodes, weights = np.polynomial.legendre.leggauss(_CYCLE_NODES)
    parts = []
    for first in range(0, count, _CYCLES):
        begin = np.arange(first, min(first + _CYCLES, count)) * step
        matrices = np.asarray(attitude(begin[:, None] + step * (1 + nodes) / 2))
        parts.append(np.einsum("cnji,j,n->ci", matrices, vector, weights * step / 2))
    return np.concatenate(parts)
