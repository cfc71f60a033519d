"""Runs a described system on several back ends from the counts of one vehicle, and compares what it navigates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems import system_inputs
from strapgen.navigation.systems.budget import Budget, budget
from strapgen.navigation.systems.compiled_system import CompiledSystem
from strapgen.navigation.systems.system import Cell
from strapgen.navigation.systems.system_backends import SystemMemory, SystemRunner, system_runner
from strapgen.navigation.systems.system_cost import measured_budget
from strapgen.navigation.systems.system_runs import matrices
from strapgen.navigation.systems.turning_vehicle import TurningVehicle
from strapgen.navigation.systems.wiring import Description
from strapgen.run import backends

Array = NDArray[np.float64]
#: The back end that the others are compared with.
REFERENCE = "c"
#: Radius by which an angle of position becomes a distance, in m.
_RADIUS = 6378137.0


@dataclass(frozen=True)
class NavigationErrors:
    """How far one back end has gone from another."""

    backend: str
    #: (N,): angle between the attitudes in rad, length of the difference of velocities in m/s, distance of the
    #: positions in m, after each of their cycles; empty where the system has no such output
    attitude: Array
    velocity: Array
    position: Array


@dataclass(frozen=True)
class SystemStudy:
    """The result of a study."""

    description: Description
    seconds: float
    #: (N,): angle between the attitude of the reference and the true one in rad; empty without an attitude
    against_truth: Array
    #: Of every other back end against the reference
    errors: tuple[NavigationErrors, ...]
    #: Memory and operations of the code of each back end in C
    needs: Mapping[str, Budget]


def study(
    description: Description,
    vehicle: TurningVehicle,
    seconds: Fraction,
    names: Iterable[str],
    settings: Settings | None = None,
    cpu: str = "",
) -> SystemStudy:
    """Run a system on back ends.

    `description`: its inputs are increments or counts of gyros and accelerometers in body axes.
    """
    inputs = samples(description, vehicle, seconds)
    outputs = Outputs.of(description)

    needs: dict[str, Budget] = {}

    def run(name: str) -> tuple[SystemRunner, Mapping[str, Array]]:
        fixed = backends.BACKENDS[name].fixed
        runner = system_runner(description, name, settings if fixed else None)
        if isinstance(runner, CompiledSystem):
            needs[name] = measured_budget(runner.fit, cpu) if cpu and fixed else budget(runner.fit)
        return runner, runner.run(inputs, started(runner, outputs, vehicle)).values

    runner, values = run(REFERENCE)
    errors = tuple(
        outputs.between(name, run(name)[1], values) for name in dict.fromkeys(names) if name != REFERENCE
    )
    truth = np.empty(0)
    if outputs.attitude is not None:
        every = runner.system.every(outputs.attitude.name)
        attitudes = matrices(outputs.attitude.signal, values[outputs.attitude.name])
        times = np.arange(1.0, len(attitudes) + 1) * float(every / runner.system.sample_hz)
        truth = angles(attitudes, vehicle.attitude(times))
    return SystemStudy(description, float(seconds), truth, errors, needs)


def samples(description: Description, vehicle: TurningVehicle, seconds: Fraction) -> dict[str, Array]:
    """Return what a system measures on a vehicle, by the names of its inputs.

    An input in rad or m/s takes increments. One of counts takes those of the unit that the stage has to which it is
    wired, angle-counts or velocity-counts. Where a stage compensates the errors of a measurement unit, the sensors have
    these errors: the kernel that is its inverse makes them.
    """
    system = description.system
    cycles = system_inputs.cycles_of(system, seconds)
    angle, velocity = vehicle.increments(float(1 / system.sample_hz), cycles)
    return system_inputs.samples(description, angle, velocity)


@dataclass(frozen=True)
class Outputs:
    """The cells of a system's outputs that a navigator is judged by; None for what it has not."""

    attitude: Cell | None
    velocity: Cell | None
    position: Cell | None

    @classmethod
    def of(cls, description: Description) -> Outputs:
        """Return the first output of each kind."""
        cells = [description.system.cell(name) for name in description.system.outputs]

        def first(frame: str, constraint: bool, unit: str) -> Cell | None:
            fitting = (
                cell
                for cell in cells
                if (cell.signal.frame, bool(cell.signal.constraint), cell.signal.unit)
                == (frame, constraint, unit)
            )
            return next(fitting, None)

        return cls(first("b to n", True, "1"), first("n", False, "m/s"), first("n to e", True, "1"))

    def between(self, name: str, one: Mapping[str, Array], other: Mapping[str, Array]) -> NavigationErrors:
        """Return how far one run is from another."""
        empty = np.empty(0)

        def turned(cell: Cell | None) -> Array:
            if cell is None:
                return empty
            return angles(matrices(cell.signal, one[cell.name]), matrices(cell.signal, other[cell.name]))

        velocity = empty
        if self.velocity is not None:
            velocity = np.linalg.norm(one[self.velocity.name] - other[self.velocity.name], axis=-1)
        return NavigationErrors(name, turned(self.attitude), velocity, turned(self.position) * _RADIUS)


def started(runner: SystemRunner, outputs: Outputs, vehicle: TurningVehicle) -> SystemMemory:
    """Return the memory of a system that begins with the attitude of a vehicle."""
    memory = runner.begin()
    if outputs.attitude is not None:
        attitude = vehicle.attitude(np.zeros(1))[0]
        if outputs.attitude.signal.size == 4:
            attitude = backends.evaluator("euler-from-dcm")(attitude)
        runner.set(memory, outputs.attitude.name, attitude)
    return memory


def angles(one: Array, other: Array) -> Array:
    """Return the angle between attitudes in rad, from the antisymmetric part of their quotient."""
    turned = one @ other.swapaxes(-1, -2)
    skew = (turned - turned.swapaxes(-1, -2)) / 2
    return np.asarray(np.sqrt(skew[..., 2, 1] ** 2 + skew[..., 0, 2] ** 2 + skew[..., 1, 0] ** 2))
