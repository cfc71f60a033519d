"""Runs an attitude and heading reference, a described system, at rest through a schedule of gains."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen.navigation.loops.loop_schedule import LoopMode, LoopSchedule
from strapgen.navigation.loops.loops_study import mode_gains
from strapgen.navigation.systems.system_backends import SystemMemory, SystemRun, SystemRunner

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RestingSensors:
    """What the sensors of a body at rest measure, whose axes are those of the level frame, z down."""

    #: In rad/s, axes n
    earth_rate: tuple[float, float, float] = (7.292115e-5, 0.0, 0.0)
    #: In rad/s
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: In m/s^2
    accelerometer_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: Of the flux valve in rad, and of the air data in m
    heading: float = 0.0
    height: float = 0.0

    def samples(self, schedule: LoopSchedule, mode: LoopMode, count: int) -> dict[str, Array]:
        """Return samples of all inputs of ``examples/ahrs.toml`` for cycles of a mode."""
        T = float(schedule.cycle_s)
        force = np.add(self.accelerometer_bias, (0.0, 0.0, -float(schedule.gravity)))
        row = {
            "gyro": T * np.add(self.earth_rate, self.gyro_bias),
            "accelerometer": T * force,
            "airspeed": np.zeros(2),
            "flux_valve": np.array(self.heading),
            "air_height": np.array(self.height),
        }
        for setting in mode.loops:
            loop = setting.loop
            for number, gain in enumerate(mode_gains(schedule, setting), 1):
                row[f"{loop}_k{number}"] = np.array(float(gain))
        return {name: np.broadcast_to(value, (count, *value.shape)) for name, value in row.items()}


def run_modes(
    runner: SystemRunner,
    schedule: LoopSchedule,
    parts: Iterable[tuple[LoopMode, Fraction]],
    sensors: RestingSensors,
    memory: SystemMemory | None = None,
) -> list[SystemRun]:
    """Run a reference system through modes for some time each, one after the other.

    `parts`: with the time in s.
    """
    runs: list[SystemRun] = []
    for mode, seconds in parts:
        count = int(seconds / schedule.cycle_s)
        begin = runs[-1].memory if runs else memory
        runs.append(runner.run(sensors.samples(schedule, mode, count), begin))
    return runs


def tilt(attitude: Array) -> Array:
    """Return the errors of small computed attitudes whose true one is no rotation, C = I + [phi x], (..., 3) in rad."""
    C = np.asarray(attitude, float)
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(C[..., i, j] - C[..., j, i]) / 2 for i, j in pairs], axis=-1)
