"""A course over the earth as legs, one after the other: each adds pulses to the controls of a vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.navigation.vehicle.controls import Controls, Pulse

#: Time in s in which acceleration, climb or turn begins or ends where it lasts long enough.
EDGE = 3.0


@dataclass
class Legs:
    """Legs up to now, with the state of the vehicle at their end."""

    #: At the end, in m/s, m over the start, and s
    speed: float = 0.0
    climbed: float = 0.0
    time: float = 0.0
    controls: Controls = field(default_factory=Controls)

    @classmethod
    def begun(cls, speed: float, heading: float) -> Legs:
        """Return a course at its start."""
        return cls(speed=speed, controls=Controls(speed=speed, heading=heading))

    def hold(self, seconds: float) -> None:
        """Go straight on."""
        self.time += seconds

    def accelerate(self, speed: float, acceleration: float) -> None:
        """Go straight on until another speed is reached."""
        if speed < 0:
            raise InputError(f"the speed of a leg is {speed:g} m/s; 0 or more is needed")
        change = speed - self.speed
        pulse = self._pulse(change, math.copysign(acceleration, change))
        self.controls = replace(self.controls, accelerations=(*self.controls.accelerations, *pulse))
        self.speed = speed

    def climb(self, gain: float, rate: float) -> None:
        """Climb or descend by so many m."""
        if not self.speed:
            raise InputError("a vehicle that stands does not climb; accelerate first")
        pulse = self._pulse(gain, math.copysign(rate, gain))
        self.controls = replace(self.controls, climbs=(*self.controls.climbs, *pulse))
        self.climbed += gain

    def turn(self, angle: float, rate: float, banks: bool = True) -> None:
        """Turn by so many rad, clockwise if positive, at a rate in rad/s."""
        pulse = self._pulse(angle, math.copysign(rate, angle))
        controls = self.controls
        if banks:
            self.controls = replace(controls, turns=(*controls.turns, *pulse))
        else:
            self.controls = replace(controls, flat_turns=(*controls.flat_turns, *pulse))

    def bank_rate(self, bank: float) -> float:
        """Return the rate of a turn in rad/s in which nothing is pushed aside at a bank in rad."""
        if not self.speed:
            raise InputError("a vehicle that stands does not bank; accelerate first")
        return STANDARD_GRAVITY * math.tan(bank) / self.speed

    def _pulse(self, integral: float, value: float) -> tuple[Pulse, ...]:
        """Return a pulse from now on with an integral, after which the leg ends; none for nothing."""
        if integral == 0:
            return ()
        length = integral / value
        edge = min(EDGE, length)
        pulse = Pulse(self.time + edge / 2, self.time + edge / 2 + length, edge, value)
        self.time += length + edge
        return (pulse,)
