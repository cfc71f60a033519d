"""What the sensors of a described system measure on a motion or along a recording, as samples of its inputs."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import CYCLE, Signal
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.navigation.systems.wiring import Description
from strapgen.run import backends as run
from strapgen.run.increments import pulses

Array = NDArray[np.float64]

#: What an input can measure, by its unit: which increments, and whether they are divided by the cycle.
_UNITS = {"rad": (0, False), "rad/s": (0, True), "m/s": (1, False), "m/s^2": (1, True)}


def samples(description: Description, angle: Array, velocity: Array) -> dict[str, Array]:
    """Return samples of a system's inputs from exact increments in body axes.

    An input takes increments, or mean rates and accelerations over a cycle, by its unit. One of counts takes whole
    counts of the scale that the stage has to which it is wired, angle-counts or velocity-counts; what is left over goes
    into the next count. Where a stage compensates the errors of a measurement unit, the sensors have these errors: the
    kernel that is its inverse makes them. The navigation frame rests: an input of its rotation is zero.

    `angle, velocity` (cycles, 3): increments in rad and m/s, body axes. Returns (cycles, 3).
    """
    system = description.system
    sensed = _sensed(description, angle, velocity)
    result = {}
    for signal in system.inputs:
        if signal.shape == (3,) and signal.frame == "n" and signal.unit in ("rad", "rad/s"):
            result[signal.name] = np.zeros_like(angle)
            continue
        unit, scale = _measured(description, signal)
        if signal.frame != "b" or signal.shape != (3,) or unit not in _UNITS:
            raise InputError(
                f"input {signal.name} (unit {signal.unit}, frame {signal.frame or 'none'}) is no gyro or "
                "accelerometer in body axes; rad, rad/s, m/s, m/s^2 or counts with a constant scale are needed"
            )
        which, divided = _UNITS[unit]
        exact = sensed[which] * (float(system.sample_hz) if divided else 1.0)
        result[signal.name] = exact if scale is None else np.rint(pulses(exact[:, None], scale)[:, 0] / scale)
    return result


def _sensed(description: Description, angle: Array, velocity: Array) -> tuple[Array, Array]:
    """Return increments with the errors that the system compensates."""
    for stage in description.system.stages:
        if stage.kernel.startswith("imu-compensate"):
            constants = dict(description.choices[stage.name].constants)
            errors = run.evaluator(catalogue.choose("imu-errors", constants=constants))
            measured: tuple[Array, Array] = errors(angle, velocity)
            return measured
    return angle, velocity


def _measured(description: Description, signal: Signal) -> tuple[str, float | None]:
    """Return the unit of what an input measures, and how much of it a count is."""
    if signal.unit != "1" or signal.over != CYCLE:
        return signal.unit, None
    for stage in description.system.stages:
        takes = any(wire.external and wire.source == signal.name for wire in stage.wires)
        scale = dict(description.choices[stage.name].constants).get("scale")
        if takes and scale is not None and len(scale) == 1:
            return description.programs[stage.name].outputs[0].signal.unit, float(scale[0])
    return signal.unit, None


def cycles_of(system: DescribedSystem, seconds: Fraction) -> int:
    """Return the cycles of the samples in a time."""
    cycles = seconds * system.sample_hz
    if cycles > checks.MOST:
        raise InputError(
            f"a duration of {float(seconds):.3g} s has too many cycles of {float(1 / system.sample_hz):g} s; "
            f"up to {checks.MOST:,} are run"
        )
    if cycles.denominator != 1 or cycles % system.cycle or not cycles:
        raise InputError(
            f"{float(seconds):g} s are no whole number of cycles of the slowest rate, "
            f"{float(system.cycle / system.sample_hz):g} s"
        )
    return int(cycles)
