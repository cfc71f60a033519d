"""What the sensors of a described system measure on a motion or along a recording, as samples of its inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import backends, catalogue
from strapgen.backends.increments import pulses
from strapgen.ir.signals import CYCLE, Signal
from strapgen.ir.system import DescribedSystem
from strapgen.support import checks
from strapgen.support.exceptions import InputError
from strapgen.systems.wiring import Description

Array = NDArray[np.float64]

#: Cycles whose velocity increments are computed together, and nodes of Gauss's rule in each.
_BLOCK, _NODES = 1 << 14, 4
#: What an input can measure, by its unit: which increments, and whether they are divided by the cycle.
_UNITS = {"rad": (0, False), "rad/s": (0, True), "m/s": (1, False), "m/s^2": (1, True)}


def samples(description: Description, angle: Array, velocity: Array) -> dict[str, Array]:
    """Return samples of a system's inputs from exact increments in body axes.

    An input takes increments, or mean rates and accelerations over a cycle, by its unit. One of counts takes whole
    counts of the scale that the stage has to which it is wired, angle-counts or velocity-counts; what is left over goes
    into the next count. Where a stage compensates the errors of a measurement unit, the sensors have these errors: the
    kernel that is its inverse makes them. The navigation frame rests: an input of its rotation is zero.

    Parameters
    ----------
    description : Description
    angle, velocity : array, (cycles, 3)
        Increments in rad and m/s, body axes.

    Returns
    -------
    dict of str to array, (cycles, 3)

    Raises
    ------
    InputError
        If an input is none of these.
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
            errors = backends.evaluator(catalogue.choose("imu-errors", constants=constants))
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
    """Return the cycles of the samples in a time.

    Raises
    ------
    InputError
        If the time holds no whole number of cycles of all rates, or too many.
    """
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


def velocity_increments(
    attitude: Callable[[Array], Any], force: Iterable[float], interval: Fraction, count: int
) -> Array:
    """Return the velocity increments of a specific force that is constant in reference axes.

    Parameters
    ----------
    attitude : callable
        Returns direction cosine matrices, body to reference, at some times in s.
    force : iterable of float, (3,)
        In m/s^2, reference axes.
    interval : Fraction
        Length of a cycle in s.
    count : int

    Returns
    -------
    array, (count, 3)
        In m/s, body axes; Gauss's rule integrates each cycle.
    """
    vector, step = np.array([*force], float), float(interval)
    if not vector.any():
        return np.zeros((count, 3))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    parts = []
    for first in range(0, count, _BLOCK):
        begin = np.arange(first, min(first + _BLOCK, count)) * step
        matrices = np.asarray(attitude(begin[:, None] + step * (1 + nodes) / 2))
        parts.append(np.einsum("cnji,j,n->ci", matrices, vector, weights * step / 2))
    return np.concatenate(parts)
