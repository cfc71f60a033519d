"""A gyro whose float a pulse torquing loop holds: the plant, exactly from cycle to cycle, and runs of the loop.

The float obeys tau0 th'' + th' = w - k Q_T/dt, with the rate w and the pulses k of a cycle held over it. The command of
a cycle acts in the next one, and is limited. The control law is that of the kernel ``pulse-torque``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]
#: Arc seconds in a degree.
_ARCSEC = 3600.0


@dataclass(frozen=True)
class TorqueLoop:
    """Constants of the control law, and of the gyro.

    The numbers are those of a fit to the printed responses; gain, quantum, lag and delay are not printed.
    """

    #: K_s, C1, C2, C3 and K_L, see the kernel
    gain: float = 9 / 32
    lag_gain: float = 3 / 64
    lag_pole: float = 1 / 2
    integral_gain: float = 1 / 32
    leak: float = 1 / 128
    #: Q_AD, a quantum of the float angle
    quantum_arcsec: float = 8.0
    #: tau0, time constant of the float
    lag_s: float = 1 / 3200
    #: Cycles in a second
    cycle_hz: float = 3200.0
    #: Largest rate, that of the largest command in every cycle
    largest_deg_s: float = 150.0
    #: The largest command
    largest_pulses: int = 60
    #: Cycles from a command to its pulses
    delay_cycles: int = 1

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if not 0 < value < math.inf:
                raise InputError(f"{one.name} is {value:g}; a number above 0 is needed")
        for name in ("gain", "lag_gain", "lag_pole", "integral_gain", "leak"):
            if getattr(self, name) > 1:
                raise InputError(f"{name} is {getattr(self, name):g}; at most 1 is allowed")

    @property
    def cycle(self) -> float:
        """Length of a cycle in s."""
        return 1 / self.cycle_hz

    @property
    def pulse_arcsec(self) -> float:
        """Q_T, the angle of a torquer pulse."""
        return self.largest_deg_s * _ARCSEC * self.cycle / self.largest_pulses

    @property
    def constants(self) -> tuple[float, ...]:
        """The constants of the control law, in the order of the kernel."""
        return self.gain, self.lag_gain, self.lag_pole, self.integral_gain, self.leak

    @property
    def steady_gain(self) -> float:
        """K_s (1/(1 + Kf) + C3 (1 - K_L)/K_L): pulses a cycle for a quantum, long after a rate began."""
        feedback = self.lag_gain / (1 - self.lag_pole)
        return self.gain * (1 / (1 + feedback) + self.integral_gain * (1 - self.leak) / self.leak)

    @cached_property
    def law(self) -> list[list[float]]:
        """The rows of the states after a cycle and of the command, in filtered, integrated and angle: it is linear."""
        filtered, integrated, angle = np.eye(3)
        rows = evaluator("pulse-torque")(filtered, integrated, angle, *self.constants)
        return [[float(value) for value in row] for row in rows]

    def _commanded(self, filtered: float, integrated: float, angle: float) -> list[float]:
        """Return the states after a cycle, and the command."""
        return [a * filtered + b * integrated + c * angle for a, b, c in self.law]

    def plant(self, angle: Any, rate: Any, input_rate: Any) -> tuple[Any, Any]:
        """Return angle in arcsec and rate in arcsec/s of the float after a cycle of a constant input in arcsec/s."""
        left = math.exp(-self.cycle / self.lag_s)
        return (
            angle + input_rate * self.cycle + (rate - input_rate) * self.lag_s * (1 - left),
            input_rate + (rate - input_rate) * left,
        )

    def matrices(self) -> tuple[Array, Array, Array]:
        """Return A, B, C of the loop without limit and quanta.

        The state is the float's angle in quanta, its rate in quanta a cycle, the states of the control law, and the
        commands under way; the input is a rate, and the output the commanded rate, both in quanta a cycle.
        """
        size = 4 + self.delay_cycles
        columns = [self._linear(vector, 0.0) for vector in np.eye(size)]
        outputs = [self._command(vector) for vector in np.eye(size)]
        return np.array(columns).T, self._linear(np.zeros(size), 1.0), np.array(outputs)

    def _command(self, state: Array) -> float:
        """Return the rate that the torquer makes up for in a cycle, in quanta a cycle."""
        return float(state[-1] * self.pulse_arcsec / self.quantum_arcsec)

    def _linear(self, state: Array, rate: float) -> Array:
        """Return the state after a cycle."""
        scale = self.quantum_arcsec
        net = (rate - self._command(state)) * scale * self.cycle_hz
        angle, speed = self.plant(state[0] * scale, state[1] * scale * self.cycle_hz, net)
        filtered, integrated, command = self._commanded(state[2], state[3], state[0])
        moved = [angle / scale, speed / scale * self.cycle, filtered, integrated, command, *state[4:-1]]
        return np.array(moved, float)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of the linear loop in z, the largest first."""
        poles = np.linalg.eigvals(self.matrices()[0]).astype(complex)
        return poles[np.argsort(-np.abs(poles))]

    def require_stable(self) -> None:
        """Refuse a loop whose oscillations grow."""
        largest = float(abs(self.poles[0]))
        if largest >= 1:
            raise InputError(
                f"the loop is unstable: a pole of its linear form has the magnitude {largest:.4g}; below 1 is needed, "
                "so a smaller gain or delay"
            )

    def response(self, hertz: Any) -> Array:
        """Return the gain from the input rate to the commanded rate at frequencies in Hz."""
        a, b, c = self.matrices()
        z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(hertz, float)) * self.cycle)
        gains = [abs(c @ np.linalg.solve(x * np.eye(len(a)) - a, b)) for x in z]
        return np.array(gains)

    def run(
        self,
        rate_deg_s: Callable[[Any], Any],
        cycles: int,
        angle_arcsec: float = 0.0,
        quantised: bool = False,
    ) -> tuple[Array, Array]:
        """Run the loop.

        `rate_deg_s`: the rate of the gyro's case in deg/s, from times in s. Returns (cycles,): of the float in
        arcsec at the beginning of each cycle. Returns (cycles,): in pulses.
        """
        times = np.arange(cycles) * self.cycle
        rates = rate_deg_s(times) * _ARCSEC + 0 * times
        angles, commands = np.empty(cycles), np.empty(cycles)
        angle, speed, filtered, integrated = angle_arcsec, 0.0, 0.0, 0.0
        under_way = [0.0] * self.delay_cycles
        for k in range(cycles):
            seen = angle / self.quantum_arcsec
            read = float(round(seen)) if quantised else seen
            filtered, integrated, command = self._commanded(filtered, integrated, read)
            if quantised:
                command = float(max(-self.largest_pulses, min(self.largest_pulses, round(command))))
            angles[k], commands[k] = angle, command
            net = rates[k] - under_way.pop(0) * self.pulse_arcsec * self.cycle_hz
            under_way.append(command)
            angle, speed = self.plant(angle, speed, net)
        return angles, commands
