"""Speed, climb and turn of a vehicle against time, as sums of pulses with smooth edges whose integrals are closed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.units import STANDARD_GRAVITY

Array = NDArray[np.float64]


def _step(x: Array, derivative: int) -> Array:
    """Return a step from 0 at x = 0 to 1 at 1 with two continuous derivatives; its integral at -1."""
    inside = np.clip(x, 0, 1)
    if derivative < 0:
        return inside**4 * (2.5 - inside * (3 - inside)) + np.maximum(x - 1, 0)
    if derivative == 0:
        return inside**3 * (10 - inside * (15 - 6 * inside))
    return 30 * (inside * (1 - inside)) ** 2


@dataclass(frozen=True)
class Pulse:
    """A value between two times in s, whose edges take `edge` s each and are centred on the times.

    >>> pulse = Pulse(0.5, 4.5, 1.0, 2.0)
    >>> pulse(np.array([0.0, 0.5, 2.0, 5.0])).tolist(), pulse(np.array([9.0]), -1).tolist()
    ([0.0, 1.0, 2.0, 0.0], [8.0])
    """

    start: float
    end: float
    edge: float
    value: float

    def __call__(self, time: Array, derivative: int = 0) -> Array:
        """Return the pulse at some times, its first derivative, or at -1 its integral."""
        scale = self.value / self.edge**derivative
        places = ((time - moment) / self.edge + 0.5 for moment in (self.start, self.end))
        rise, fall = (_step(place, derivative) for place in places)
        result: Array = scale * (rise - fall)
        return result


@dataclass(frozen=True)
class Waves:
    """A sum of sines, with its derivatives."""

    amplitudes: Array
    #: In rad/s
    frequencies: Array
    phases: Array

    def __call__(self, time: Array, derivative: int = 0) -> Array:
        """Return the sum at some times, or its derivative."""
        total = np.zeros_like(time)
        for a, w, phase in zip(self.amplitudes, self.frequencies, self.phases, strict=True):
            total += a * w**derivative * np.sin(w * time + phase + derivative * math.pi / 2)
        return total


#: What a control is made of.
Part = Pulse | Waves


def _total(parts: Iterable[Part], time: Array, derivative: int) -> Array:
    total = np.zeros_like(time)
    for part in parts:
        total += part(time, derivative)
    return total


@dataclass(frozen=True)
class Controls:
    """What moves a vehicle: its speed at the start, and pulses of acceleration, climb rate and rate of turn.

    The heading is that in wander-azimuth axes, in which a great circle is straight.
    """

    #: Along the horizontal track at the start, in m/s
    speed: float = 0.0
    #: At the start, clockwise from north, in rad
    heading: float = 0.0
    #: In m/s^2 along the track
    accelerations: tuple[Part, ...] = ()
    #: In m/s upwards
    climbs: tuple[Part, ...] = ()
    #: In rad/s, clockwise: in which the vehicle banks, so that nothing in it is pushed aside; and flat ones
    turns: tuple[Part, ...] = ()
    flat_turns: tuple[Part, ...] = ()
    #: Further roll, pitch and heading in rad; with the velocity of a vibration along x and y in m/s
    waves: Mapping[str, tuple[Waves, ...]] = field(default_factory=dict)

    def ground_speed(self, time: Array) -> Array:
        """Return the horizontal speed in m/s."""
        return self.speed + _total(self.accelerations, time, -1)

    def height_gain(self, time: Array) -> Array:
        """Return the height over that of the start in m."""
        return _total(self.climbs, time, -1)

    def _turn(self, time: Array, derivative: int) -> Array:
        return _total((*self.turns, *self.flat_turns), time, derivative)

    def velocity(self, time: Array) -> tuple[Array, Array]:
        """Return velocity in m/s and its derivative in wander-azimuth axes n, (..., 3) each."""
        speed, turn = self.ground_speed(time), self._turn(time, 0)
        heading = self.heading + self._turn(time, -1)
        s, c = np.sin(heading), np.cos(heading)
        along, across = _total(self.accelerations, time, 0), speed * turn
        up, lift = _total(self.climbs, time, 0), _total(self.climbs, time, 1)
        velocity = np.stack([speed * s, speed * c, up], axis=-1)
        return velocity, np.stack([along * s + across * c, along * c - across * s, lift], axis=-1)

    def angles(self, time: Array) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
        """Return roll, pitch and heading in rad, and their rates in rad/s."""
        zero = np.zeros_like(time)
        speed, along = self.ground_speed(time), _total(self.accelerations, time, 0)
        turn, heading = self._turn(time, 0), self.heading + self._turn(time, -1)
        roll = roll_rate = pitch = pitch_rate = zero
        if self.turns:
            banked, turning = _total(self.turns, time, 0), _total(self.turns, time, 1)
            tangent = speed * banked / STANDARD_GRAVITY
            roll = np.arctan(tangent)
            roll_rate = (along * banked + speed * turning) / STANDARD_GRAVITY / (1 + tangent**2)
        if self.climbs:
            up, lift = _total(self.climbs, time, 0), _total(self.climbs, time, 1)
            square = np.maximum(speed**2 + up**2, np.finfo(float).tiny)
            pitch, pitch_rate = np.arctan2(up, speed), (lift * speed - up * along) / square
        values, rates = [roll, pitch, heading], [roll_rate, pitch_rate, turn]
        for place, name in enumerate(("roll", "pitch", "heading")):
            for wave in self.waves.get(name, ()):
                values[place] = values[place] + wave(time)
                rates[place] = rates[place] + wave(time, 1)
        return (values[0], values[1], values[2]), (rates[0], rates[1], rates[2])

    def shaking(self, time: Array) -> tuple[Array, Array]:
        """Return velocity in m/s and acceleration in m/s^2 of a vibration in body axes, (..., 3) each."""
        parts = []
        for derivative in (0, 1):
            columns = []
            for name in ("velocity_x", "velocity_y"):
                total = np.zeros_like(time)
                for wave in self.waves.get(name, ()):
                    total += wave(time, derivative)
                columns.append(total)
            parts.append(np.stack([*columns, np.zeros_like(time)], axis=-1))
        return parts[0], parts[1]

    @property
    def stands(self) -> bool:
        """Whether the vehicle stays where it is."""
        return self.speed == 0 and not self.accelerations

    @property
    def end(self) -> float:
        """Time in s beyond which nothing is known."""
        return math.inf

    @property
    def edges(self) -> list[float]:
        """Times in s at which a third derivative jumps."""
        parts = (*self.accelerations, *self.climbs, *self.turns, *self.flat_turns)
        return sorted(
            moment + side * part.edge / 2
            for part in parts
            if isinstance(part, Pulse)
            for moment in (part.start, part.end)
            for side in (-1, 1)
            if math.isfinite(moment)
        )

    @property
    def highest(self) -> float:
        """Highest frequency of a wave in rad/s."""
        waves = [wave for some in self.waves.values() for wave in some]
        waves += [part for part in self.turns if isinstance(part, Waves)]
        return max((float(wave.frequencies.max()) for wave in waves), default=0.0)
